//! The report as a page that is served and kept up to date: the same, with its scripts as files of their own and one
//! more beside them. Whoever serves it says what it may load.

/// What a report by itself may load: nothing.
pub const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; connect-src 'none'; base-uri 'none'; form-action 'none'";
/// The library that draws.
pub const THREE: &str = include_str!("three/three.min.js");
/// The report's own script.
pub const SCRIPT: &str = include_str!("page/report.js");

/// What a served page adds to a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Addition {
    /// Elements of the head, as HTML.
    pub head: String,
    /// What stands below the motion, as HTML.
    pub bench: String,
    /// Addresses of scripts: the library, the report's, the page's own.
    pub scripts: [String; 3],
}

/// A report for serving: without a policy of its own, which only the server can state now.
pub fn served(page: &str, add: &Addition) -> String {
    let policy = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">");
    let inline = format!("<script>{THREE}</script>\n<script>{SCRIPT}</script>\n");
    let [three, script, own] = &add.scripts;
    let files = format!(
        "<script src=\"{three}\"></script>\n<script src=\"{script}\"></script>\n<script src=\"{own}\"></script>\n"
    );
    // Each stands there once: what a design says is escaped and cannot be taken for it.
    page.replacen(&policy, &add.head, 1).replacen(&inline, &files, 1).replacen(
        "<!-- bench -->",
        &add.bench,
        1,
    )
}
