//! The only client of pest: text to concrete tree by `grammar/mech.pest`, and the question
//! "what was expected here" for what a catch-all rule took.

use super::tree::{Kind, Node, fill};
use pest::error::{ErrorVariant, InputLocation};
use pest::iterators::Pair;
use pest::{Parser, Token};

#[derive(pest_derive::Parser)]
#[grammar = "../grammar/mech.pest"]
struct Mech;

/// Parses a whole file, item by item: the parser's own list of a large file would not fit into the processor's caches.
/// The grammar accepts every text; `None` would be a fault of the grammar.
pub(super) fn tree(source: &str) -> Option<Node> {
    let mut children = Vec::new();
    let mut filled = 0;
    // A byte order mark is filled in with the rest of what is no item.
    let mut at = if source.starts_with('\u{FEFF}') { '\u{FEFF}'.len_utf8() } else { 0 };
    while let Some(pair) = source.get(at..).and_then(|rest| Mech::parse(Rule::next_item, rest).ok()?.next()) {
        let end = at + pair.as_span().end();
        for child in nodes(pair, at, source) {
            fill(source, filled..child.start as usize, &mut children);
            filled = child.end as usize;
            children.push(child);
        }
        at = end;
    }
    Mech::parse(Rule::rest_of_file, source.get(at..)?).ok()?;
    fill(source, filled..source.len(), &mut children);
    Some(Node { kind: Kind::File, start: 0, end: source.len() as u32, children: children.into() })
}

/// What a broken part should have been.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// A statement of a mechanism or flexure.
    Statement,
    /// A top-level declaration.
    Item,
    /// A term of `minimize`.
    Term,
    /// `name = value`.
    Field,
}

/// Where and why a part could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Failure {
    /// Byte offset in the file.
    pub at: usize,
    /// What could have stood there, in the user's words, most telling first.
    pub expected: Vec<String>,
}

/// Parses the part of `source` from `start` as what it should have been.
/// `None` if it can be read, or starts with something else altogether.
pub(super) fn why(source: &str, start: usize, wanted: Wanted) -> Option<Failure> {
    let rule = match wanted {
        Wanted::Statement => Rule::whole_statement,
        Wanted::Item => Rule::whole_item,
        Wanted::Term => Rule::whole_term,
        Wanted::Field => Rule::whole_field,
    };
    let error = Mech::parse(rule, source.get(start..)?).err()?;
    let offset = match error.location {
        InputLocation::Pos(at) | InputLocation::Span((at, _)) => at,
    };
    let ErrorVariant::ParsingError { positives, .. } = error.variant else {
        return None;
    };
    Some(Failure { at: start + offset, expected: expectations(&positives) })
}

/// The user's words for the rules that could have stood at a place. What may follow almost
/// anything (operators, units) is named only if nothing else could stand there.
fn expectations(rules: &[Rule]) -> Vec<String> {
    let strong: Vec<Rule> = rules.iter().copied().filter(|r| !is_weak(*r)).collect();
    let mut named: Vec<(u8, String)> = Vec::new();
    for rule in if strong.is_empty() { rules } else { &strong } {
        let word = words(*rule);
        // The end of the line is the least telling: it comes last.
        let rank = u8::from(*rule == Rule::line_end);
        if !named.iter().any(|(_, w)| *w == word) {
            named.push((rank, word));
        }
    }
    named.sort_by_key(|(rank, _)| *rank);
    named.into_iter().map(|(_, word)| word).collect()
}

fn is_weak(rule: Rule) -> bool {
    matches!(
        rule,
        Rule::add_op
            | Rule::mul_op
            | Rule::caret
            | Rule::minus
            | Rule::unit
            | Rule::unit_op
            | Rule::unit_factor
            | Rule::unit_symbol
            | Rule::unit_power
            | Rule::dot
            | Rule::lparen
            | Rule::lbracket
            | Rule::index
            | Rule::kw_about
            | Rule::kw_direction
    )
}

fn words(rule: Rule) -> String {
    let text = match rule {
        Rule::ident | Rule::bodies => "a name",
        Rule::value | Rule::sum | Rule::product | Rule::unary | Rule::power | Rule::argument => "a value",
        Rule::free => "`free START in LOWER .. UPPER`",
        Rule::number | Rule::digits => "a number",
        Rule::exponent | Rule::integer => "a whole number",
        Rule::unit | Rule::unit_factor | Rule::unit_symbol => "a unit",
        Rule::unit_op | Rule::unit_power | Rule::add_op | Rule::mul_op | Rule::minus => "an operator",
        Rule::call => "a call such as `track(tip)`",
        Rule::name => "a name",
        Rule::term => "a term such as `track(tip)`",
        Rule::field => "`name = value`",
        Rule::product_name | Rule::numeral | Rule::numeral_word => "a product such as `stl`",
        Rule::dimension => "a dimension such as `length`",
        Rule::text => "a file name in quotes",
        Rule::path => "a path such as `std.materials.rigur`",
        Rule::compare => "`<=`, `<`, `>=` or `>`",
        Rule::line_end => "the end of the line",
        Rule::colon => "`:`",
        Rule::comma => "`,`",
        Rule::equals => "`=`",
        Rule::lbrace | Rule::points | Rule::overrides => "`{`",
        Rule::rbrace | Rule::no_brace => "`}`",
        Rule::lparen | Rule::tuple => "`(`",
        Rule::rparen => "`)`",
        Rule::lbracket | Rule::index => "`[`",
        Rule::rbracket => "`]`",
        Rule::setting => "`name = value`",
        Rule::dot => "`.`",
        Rule::range => "`..`",
        Rule::caret => "`^`",
        Rule::layer => "`layer`",
        Rule::axis => "`axis`",
        Rule::pin => "`pin`",
        Rule::fillet => "`fillet`",
        Rule::into => "`into`",
        Rule::template => "`as`",
        Rule::drum => "`drum`",
        Rule::profile => "`from`",
        Rule::by_profile | Rule::keys => "`by`",
        Rule::key => "a key such as `25 %: 10 deg`",
        Rule::rod_from => "`from`",
        Rule::rod_to => "`to`",
        Rule::rod_section => "`section`",
        Rule::turned => "`turned`",
        Rule::scaled => "`scale`",
        Rule::merging => "`merging`",
        Rule::sharing => "`sharing`",
        Rule::rod_axis => "`axis`",
        Rule::via => "`via`",
        Rule::load_gravity => "`gravity`",
        Rule::load_moment => "`moment`",
        Rule::load_force => "a value",
        other => {
            // Keyword rules are called after their keyword.
            let name = format!("{other:?}");
            return match name.strip_prefix("kw_") {
                Some(word) => format!("`{word}`"),
                None => "a statement".into(),
            };
        }
    };
    text.into()
}

/// A pair whose parts are being collected.
struct Open {
    rule: Rule,
    start: usize,
    /// Place of its first part among the finished nodes.
    first: usize,
    /// No pair stands in it.
    is_leaf: bool,
}

/// The nodes in a pair whose text begins at `base`; bytes between inner pairs become leaves. One walk over the parser's
/// tokens: a node's parts are moved into a list of just their number.
fn nodes(pair: Pair<'_, Rule>, base: usize, source: &str) -> Vec<Node> {
    let mut open: Vec<Open> = Vec::new();
    let mut finished: Vec<Node> = Vec::new();
    let mut parts: Vec<Node> = Vec::new();
    for token in pair.tokens() {
        let (this, end) = match token {
            Token::Start { rule, pos } => {
                if let Some(outer) = open.last_mut() {
                    outer.is_leaf = false;
                }
                let start = base + pos.pos();
                open.push(Open { rule, start, first: finished.len(), is_leaf: true });
                continue;
            }
            Token::End { pos, .. } => match open.pop() {
                Some(this) => (this, base + pos.pos()),
                None => break,
            },
        };
        // `3` is a sum of one product of one …: such levels say nothing and would cost stack.
        let is_level = matches!(this.rule, Rule::sum | Rule::product | Rule::unary | Rule::power);
        if matches!(this.rule, Rule::EOI | Rule::line_end | Rule::next_item)
            || is_level && finished.len() == this.first + 1
        {
            continue;
        }
        let kind = kind(this.rule);
        if !(this.is_leaf && is_token(kind)) {
            let mut at = this.start;
            for child in finished.drain(this.first..) {
                fill(source, at..child.start as usize, &mut parts);
                at = child.end as usize;
                parts.push(child);
            }
            fill(source, at..end, &mut parts);
        }
        let children = parts.drain(..).collect();
        finished.push(Node { kind, start: this.start as u32, end: end as u32, children });
    }
    finished
}

fn is_token(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::Keyword
            | Kind::Punctuation
            | Kind::Ident
            | Kind::Text
            | Kind::Digits
            | Kind::Integer
            | Kind::Exponent
            | Kind::UnitSymbol
            | Kind::UnitPower
            | Kind::UnitOperator
            | Kind::NoBrace
    )
}

fn kind(rule: Rule) -> Kind {
    match rule {
        Rule::edition => Kind::Edition,
        Rule::import => Kind::Import,
        Rule::path => Kind::Path,
        Rule::mechanism => Kind::Mechanism,
        Rule::flexure => Kind::Flexure,
        Rule::record => Kind::Record,
        Rule::bad_header => Kind::BadHeader,
        Rule::bad_heading => Kind::BadHeading,
        Rule::stray => Kind::Stray,
        Rule::bad_statement => Kind::BadStatement,
        Rule::bad_term => Kind::BadTerm,
        Rule::bad_field => Kind::BadField,
        Rule::st_param => Kind::Param,
        Rule::dimension => Kind::Dimension,
        Rule::st_let => Kind::Let,
        Rule::st_point => Kind::Point,
        Rule::st_body => Kind::Body,
        Rule::points => Kind::Points,
        Rule::layer => Kind::Layer,
        Rule::st_joint => Kind::Joint,
        Rule::bodies => Kind::Bodies,
        Rule::axis => Kind::Axis,
        Rule::pin => Kind::Pin,
        Rule::fillet => Kind::Fillet,
        Rule::into => Kind::Into,
        Rule::template => Kind::Template,
        Rule::overrides => Kind::Overrides,
        Rule::field => Kind::Field,
        Rule::st_material => Kind::MaterialUse,
        Rule::st_print => Kind::Print,
        Rule::st_links => Kind::Links,
        Rule::st_model => Kind::Model,
        Rule::st_cycle => Kind::Cycle,
        Rule::st_drive => Kind::Drive,
        Rule::profile => Kind::Range,
        Rule::by_profile => Kind::By,
        Rule::keys => Kind::Keys,
        Rule::key => Kind::Key,
        Rule::drum => Kind::Drum,
        Rule::st_rest => Kind::Rest,
        Rule::st_trace => Kind::Trace,
        Rule::st_output => Kind::Output,
        Rule::st_target => Kind::Target,
        Rule::st_minimize => Kind::Minimize,
        Rule::term => Kind::Term,
        Rule::st_require => Kind::Require,
        Rule::st_export => Kind::Export,
        Rule::product_name => Kind::Artefact,
        Rule::st_rod => Kind::Rod,
        Rule::rod_from => Kind::RodFrom,
        Rule::rod_to => Kind::RodTo,
        Rule::rod_section => Kind::RodSection,
        Rule::st_place => Kind::Place,
        Rule::turned => Kind::Turned,
        Rule::scaled => Kind::Scaled,
        Rule::merging => Kind::Merging,
        Rule::st_mirror => Kind::Mirror,
        Rule::st_allow => Kind::Allow,
        Rule::st_workspace => Kind::Workspace,
        Rule::stretch => Kind::Stretch,
        Rule::sharing => Kind::Sharing,
        Rule::rod_axis => Kind::RodAxis,
        Rule::st_own => Kind::OwnBody,
        Rule::st_string => Kind::String,
        Rule::via => Kind::Via,
        Rule::st_load => Kind::Load,
        Rule::st_hole => Kind::Hole,
        Rule::st_mount => Kind::Mount,
        Rule::st_horn => Kind::Horn,
        Rule::st_plate => Kind::Plate,
        Rule::st_solid => Kind::Solid,
        Rule::solid_at => Kind::At,
        Rule::fit_clause | Rule::seat_clause => Kind::Fitted,
        Rule::load_gravity => Kind::Gravity,
        Rule::load_moment => Kind::Moment,
        Rule::load_force => Kind::Force,
        Rule::index => Kind::Index,
        Rule::st_assert => Kind::Assert,
        Rule::st_variant => Kind::Variant,
        Rule::setting => Kind::Setting,
        Rule::st_for => Kind::For,
        Rule::st_case => Kind::Case,
        Rule::st_later => Kind::Later,
        Rule::value => Kind::Value,
        Rule::free => Kind::Free,
        Rule::sum => Kind::Sum,
        Rule::product => Kind::Product,
        Rule::unary => Kind::Unary,
        Rule::power => Kind::Power,
        Rule::tuple => Kind::Tuple,
        Rule::call => Kind::Call,
        Rule::argument => Kind::Argument,
        Rule::about => Kind::About,
        Rule::name | Rule::numeral => Kind::Name,
        Rule::number => Kind::Number,
        Rule::unit => Kind::Unit,
        Rule::unit_factor => Kind::UnitFactor,
        Rule::ident | Rule::numeral_word => Kind::Ident,
        Rule::text => Kind::Text,
        Rule::digits => Kind::Digits,
        Rule::integer => Kind::Integer,
        Rule::exponent => Kind::Exponent,
        Rule::unit_symbol => Kind::UnitSymbol,
        Rule::unit_power => Kind::UnitPower,
        Rule::unit_op => Kind::UnitOperator,
        Rule::no_brace => Kind::NoBrace,
        Rule::colon
        | Rule::comma
        | Rule::equals
        | Rule::lbrace
        | Rule::rbrace
        | Rule::lparen
        | Rule::rparen
        | Rule::lbracket
        | Rule::rbracket
        | Rule::dot
        | Rule::range
        | Rule::add_op
        | Rule::mul_op
        | Rule::caret
        | Rule::minus
        | Rule::compare => Kind::Punctuation,
        _ => Kind::Keyword,
    }
}
