//! Tested designs as a JUnit report: a suite a design, a case a `require` line, and one case for the design itself.
//! It states no times and no host, so that the same designs give the same bytes.

use super::test::{Status, Tested, is_requirement};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

type Out = Writer<Vec<u8>>;

/// One case.
struct Case {
    name: String,
    outcome: Outcome,
}

enum Outcome {
    Pass(Option<String>),
    /// Element, type, message, text.
    Else(&'static str, String, String, String),
}

/// The report.
///
/// # Errors
/// What the writer reports; into memory that does not happen.
pub fn report(tested: &[Tested]) -> Result<String, std::io::Error> {
    let suites: Vec<Vec<Case>> = tested.iter().map(cases).collect();
    let mut out = Writer::new_with_indent(Vec::new(), b' ', 2);
    out.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let all: Vec<&Case> = suites.iter().flatten().collect();
    let mut root = BytesStart::new("testsuites");
    root.push_attribute(("name", "flexura"));
    sums(&mut root, &all);
    out.write_event(Event::Start(root))?;
    for (t, cases) in tested.iter().zip(&suites) {
        let source = clean(&t.name());
        let mut suite = BytesStart::new("testsuite");
        suite.push_attribute(("name", source.as_str()));
        sums(&mut suite, &cases.iter().collect::<Vec<_>>());
        out.write_event(Event::Start(suite))?;
        for case in cases {
            write(&mut out, &source, case)?;
        }
        out.write_event(Event::End(BytesEnd::new("testsuite")))?;
    }
    out.write_event(Event::End(BytesEnd::new("testsuites")))?;
    let mut text = String::from_utf8_lossy(&out.into_inner()).into_owned();
    text.push('\n');
    Ok(text)
}

fn sums(element: &mut BytesStart, cases: &[&Case]) {
    let of = |name: &str| {
        cases.iter().filter(|c| matches!(&c.outcome, Outcome::Else(e, ..) if *e == name)).count().to_string()
    };
    element.push_attribute(("tests", cases.len().to_string().as_str()));
    element.push_attribute(("failures", of("failure").as_str()));
    element.push_attribute(("errors", of("error").as_str()));
    element.push_attribute(("skipped", of("skipped").as_str()));
}

fn cases(t: &Tested) -> Vec<Case> {
    let others: Vec<_> = t.diagnostics.iter().filter(|d| d.is_error() && !is_requirement(d)).collect();
    let design = match (t.status, others.first()) {
        (Status::Skipped, _) => Outcome::Else("skipped", String::new(), t.why.into(), String::new()),
        (_, Some(first)) => {
            let text = t.told(|d| d.is_error() && !is_requirement(d));
            Outcome::Else("error", first.code.clone(), first.message.clone(), text)
        }
        _ => Outcome::Pass(None),
    };
    let mut cases = vec![Case { name: "design".into(), outcome: design }];
    for r in &t.requirements {
        let measured = match r.value {
            Some(v) => format!("measured {v:.6} {}", r.unit),
            None => "could not be measured".into(),
        };
        let outcome = match t.failure(r).filter(|_| !r.pass) {
            Some(d) => {
                let text = t.told(|other| other == d);
                Outcome::Else("failure", d.code.clone(), format!("{}: {measured}", r.text), text)
            }
            None if !r.pass => Outcome::Else("failure", "E0801".into(), measured, String::new()),
            None => Outcome::Pass(Some(measured)),
        };
        cases.push(Case { name: r.text.clone(), outcome });
    }
    cases
}

fn write(out: &mut Out, source: &str, case: &Case) -> Result<(), std::io::Error> {
    let mut element = BytesStart::new("testcase");
    element.push_attribute(("classname", source));
    element.push_attribute(("name", clean(&case.name).as_str()));
    out.write_event(Event::Start(element))?;
    match &case.outcome {
        Outcome::Pass(None) => {}
        Outcome::Pass(Some(said)) => {
            out.write_event(Event::Start(BytesStart::new("system-out")))?;
            out.write_event(Event::Text(BytesText::new(&clean(said))))?;
            out.write_event(Event::End(BytesEnd::new("system-out")))?;
        }
        Outcome::Else(name, kind, message, text) => {
            let mut inner = BytesStart::new(*name);
            if !kind.is_empty() {
                inner.push_attribute(("type", kind.as_str()));
            }
            inner.push_attribute(("message", clean(message).as_str()));
            out.write_event(Event::Start(inner))?;
            out.write_event(Event::Text(BytesText::new(&clean(text))))?;
            out.write_event(Event::End(BytesEnd::new(*name)))?;
        }
    }
    out.write_event(Event::End(BytesEnd::new("testcase")))
}

/// Without characters that XML has no way to write.
fn clean(text: &str) -> String {
    let allowed = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{FFFD}' | '\u{10000}'..);
    text.chars().map(|c| if allowed(c) { c } else { '\u{FFFD}' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexura::diagnostic::{Diagnostic, Origin, SourceMap};
    use flexura::pipeline::RequirementResult;

    fn requirement(text: &str, pass: bool) -> RequirementResult {
        let (text, value) = (text.into(), Some(0.5));
        RequirementResult { text, value, unit: "mm".into(), bound: 1.0, pass }
    }

    fn tested(source: &str, status: Status) -> Tested {
        Tested {
            source: source.into(),
            variant: None,
            status,
            why: "declares no mechanism",
            requirements: Vec::new(),
            diagnostics: Vec::new(),
            sources: SourceMap::default(),
        }
    }

    #[test]
    fn a_reader_finds_what_was_written() {
        let mut failing = tested("a <b> & \"c\".mech", Status::Fail);
        failing.requirements =
            vec![requirement("max(error(tip)) <= 1 mm", true), requirement("min(gap()) >= 1 mm\u{1}", false)];
        let at = failing.sources.add("a.mech", "require min(gap()) >= 1 mm\n");
        let message = "a requirement fails: min(gap()) >= 1 mm\u{1}";
        failing.diagnostics =
            vec![Diagnostic::error("E0801", message, Origin { file: at, start: 0, end: 26 })];
        let mut lost = tested("lost.mech", Status::Error);
        lost.diagnostics = vec![Diagnostic::error("E0730", "cannot read `lost.mech`", Origin::default())];
        let all = [failing, lost, tested("part.mech", Status::Skipped)];
        let text = report(&all).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        let root = document.root_element();
        let stated = |n: roxmltree::Node, a: &str| n.attribute(a).unwrap().to_string();
        assert_eq!(["tests", "failures", "errors", "skipped"].map(|a| stated(root, a)), ["5", "1", "1", "1"]);
        let suites: Vec<_> = root.children().filter(|n| n.has_tag_name("testsuite")).collect();
        assert_eq!(suites.len(), 3);
        assert_eq!(stated(suites[0], "name"), "a <b> & \"c\".mech");
        let named = |name| document.descendants().find(move |n| n.has_tag_name(name)).unwrap();
        let failure = named("failure");
        assert_eq!(stated(failure.parent().unwrap(), "name"), "min(gap()) >= 1 mm\u{FFFD}");
        assert!(failure.text().unwrap().contains("a requirement fails"), "{text}");
        assert_eq!(stated(named("error"), "type"), "E0730");
        assert_eq!(stated(named("skipped"), "message"), "declares no mechanism");
    }
}
