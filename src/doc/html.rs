//! Pages as a small static site: each file stands by itself, with its style inside, and loads nothing.

use super::{Entry, Fact, Page, Parameter, paragraphs};
use askama::Template;

/// A piece of a paragraph: whether it is code, and its text.
type Paragraph = Vec<(bool, String)>;

/// A file of the site: name and text.
pub type SiteFile = (String, String);

/// A link in a list of pages.
struct Link {
    href: String,
    path: String,
    summary: Paragraph,
}

struct Group {
    name: String,
    links: Vec<Link>,
}

#[derive(Template)]
#[template(path = "index.html")]
struct Index {
    groups: Vec<Group>,
}

struct Row<'p> {
    of: &'p Parameter,
    about: Vec<Paragraph>,
}

struct Stated<'p> {
    of: &'p Fact,
    about: Vec<Paragraph>,
}

struct Shown<'p> {
    of: &'p Entry,
    about: Vec<Paragraph>,
    tables: Vec<(&'static str, Vec<Row<'p>>)>,
    facts: Vec<Stated<'p>>,
    states: &'static str,
}

#[derive(Template)]
#[template(path = "page.html")]
struct One<'p> {
    page: &'p Page,
    about: Vec<Paragraph>,
    imports: Vec<(String, String)>,
    items: Vec<Shown<'p>>,
}

/// The site of these pages: `index.html` and a file a page, in their order.
///
/// # Errors
/// What the template engine says.
pub fn site(pages: &[Page]) -> Result<Vec<SiteFile>, String> {
    let known = |path: &str| pages.iter().any(|p| p.path == path);
    let mut groups: Vec<Group> = Vec::new();
    for page in pages {
        let name = if page.group().is_empty() { "your files" } else { page.group() };
        let summary = paragraphs(&page.summary()).into_iter().next().unwrap_or_default();
        let link = Link { href: file_name(&page.path), path: page.path.clone(), summary };
        match groups.iter_mut().find(|g| g.name == name) {
            Some(group) => group.links.push(link),
            None => groups.push(Group { name: name.into(), links: vec![link] }),
        }
    }
    let mut files = vec![("index.html".to_string(), render(&Index { groups })?)];
    for page in pages {
        let linked = page.imports.iter().filter(|i| known(i));
        let one = One {
            page,
            about: paragraphs(&page.about),
            imports: linked.map(|i| (file_name(i), i.clone())).collect(),
            items: page.items.iter().map(shown).collect(),
        };
        files.push((file_name(&page.path), render(&one)?));
    }
    Ok(files)
}

fn shown(of: &Entry) -> Shown<'_> {
    let row = |p| Row { of: p, about: paragraphs(&p.about) };
    let mut tables = Vec::new();
    for (title, all) in [("Parameters", &of.parameters), ("Free besides", &of.free)] {
        if !all.is_empty() {
            tables.push((title, all.iter().map(row).collect()));
        }
    }
    let states = if super::text::states(&of.kind) == "states" { "States" } else { "Made of" };
    let facts = of.facts.iter().map(|f| Stated { of: f, about: paragraphs(&f.about) }).collect();
    Shown { of, about: paragraphs(&of.about), tables, facts, states }
}

fn render(template: &impl Template) -> Result<String, String> {
    template.render().map_err(|e| e.to_string())
}

/// The file of a page: no character of a path may lead out of the folder.
pub fn file_name(path: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-') { c } else { '_' };
    let name: String = path.trim_end_matches(".mech").chars().map(plain).collect();
    format!("{}.html", name.trim_start_matches('.'))
}
