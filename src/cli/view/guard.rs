//! Who may ask for what. The page is for the browser on this machine alone: names that lead here from elsewhere (rebinding),
//! pages of other sites, and requests that change something without this run's token are refused.

/// What counts of a request.
#[derive(Clone, Debug, Default)]
pub struct Asked<'a> {
    /// `GET`, `POST`, …
    pub method: &'a str,
    /// As it stands in the request line.
    pub url: &'a str,
    /// Names in lower case with their values.
    pub headers: Vec<(String, &'a str)>,
    /// Bytes of the body, where that is stated.
    pub body: Option<usize>,
}

/// What can be asked for: these names and no others, so that no path leads anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// The page.
    Page,
    /// The library that draws.
    Three,
    /// The report's script.
    Report,
    /// The view's script.
    Live,
    /// The view's style.
    Style,
    /// What goes on, as it goes on.
    Events,
    /// What goes on, once.
    State,
    /// A parameter's value.
    Set,
    /// All parameters as they are written.
    Reset,
    /// Optimise.
    Solve,
    /// End an optimisation.
    Stop,
}

/// Largest body, bytes.
pub const MOST_BODY: usize = 1000;

/// The route, or the status and reason of a refusal.
pub fn admit(asked: &Asked<'_>, port: u16, token: &str) -> Result<Route, (u16, &'static str)> {
    let all = |name: &str| asked.headers.iter().filter(|h| h.0 == name).map(|h| h.1).collect::<Vec<_>>();
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    match all("host").as_slice() {
        [host] if own.iter().any(|o| o == host) => {}
        _ => return Err((421, "this address serves 127.0.0.1 only")),
    }
    let changes = asked.method == "POST";
    let (origins, sites) = (all("origin"), all("sec-fetch-site"));
    if origins.iter().any(|o| !own.iter().any(|host| o.strip_prefix("http://") == Some(host))) {
        return Err((403, "another site asks"));
    }
    if sites.iter().any(|s| !(*s == "same-origin" || *s == "none" && !changes)) {
        return Err((403, "another site asks"));
    }
    let path = asked.url.split_once('?').map_or(asked.url, |u| u.0);
    let route = match path {
        "/" => Route::Page,
        "/three.js" => Route::Three,
        "/report.js" => Route::Report,
        "/live.js" => Route::Live,
        "/live.css" => Route::Style,
        "/events" => Route::Events,
        "/state" => Route::State,
        "/set" => Route::Set,
        "/reset" => Route::Reset,
        "/solve" => Route::Solve,
        "/stop" => Route::Stop,
        _ => return Err((404, "there is nothing here")),
    };
    let is_change = matches!(route, Route::Set | Route::Reset | Route::Solve | Route::Stop);
    match asked.method {
        "GET" if !is_change => return Ok(route),
        "POST" if is_change => {}
        _ => return Err((405, "not this way")),
    }
    if origins.len() != 1 {
        return Err((403, "who asks must be stated"));
    }
    if !matches!(all("x-flexura-token").as_slice(), [given] if same(given, token)) {
        return Err((403, "the token of this run is missing"));
    }
    if all("content-type") != ["application/json"] {
        return Err((415, "it must be JSON"));
    }
    match asked.body {
        Some(bytes) if bytes <= MOST_BODY => Ok(route),
        _ => Err((413, "it is too long")),
    }
}

/// Compares in a time that does not tell where two differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |all, (x, y)| all | (x ^ y)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: [(&str, &str); 5] = [
        ("host", "127.0.0.1:80"),
        ("origin", "http://127.0.0.1:80"),
        ("x-flexura-token", "secret"),
        ("content-type", "application/json"),
        ("sec-fetch-site", "same-origin"),
    ];

    fn ask(method: &str, url: &str, headers: &[(&str, &str)]) -> Result<Route, u16> {
        let headers = headers.iter().map(|(n, v)| (n.to_string(), *v)).collect();
        admit(&Asked { method, url, headers, body: Some(2) }, 80, "secret").map_err(|e| e.0)
    }

    fn but(name: &str, value: Option<&'static str>) -> Vec<(&'static str, &'static str)> {
        let mut all: Vec<_> = GOOD.iter().copied().filter(|h| h.0 != name).collect();
        all.extend(value.map(|v| (GOOD.iter().find(|h| h.0 == name).unwrap().0, v)));
        all
    }

    #[test]
    fn what_the_page_asks_is_answered() {
        assert_eq!(ask("GET", "/", &[("host", "localhost:80")]), Ok(Route::Page));
        assert_eq!(
            ask("GET", "/?a=b", &[("host", "127.0.0.1:80"), ("sec-fetch-site", "none")]),
            Ok(Route::Page)
        );
        assert_eq!(ask("POST", "/set", &GOOD), Ok(Route::Set));
    }

    #[test]
    fn all_else_is_refused() {
        for host in ["evil.example", "127.0.0.1", "127.0.0.1:81", "127.0.0.1:80.evil.example", ""] {
            assert_eq!(ask("GET", "/", &[("host", host)]), Err(421), "{host}");
        }
        assert_eq!(ask("GET", "/", &[]), Err(421));
        assert_eq!(ask("GET", "/", &[("host", "localhost:80"), ("host", "evil.example")]), Err(421));
        for (name, value, status) in [
            ("origin", Some("http://evil.example"), 403),
            ("origin", Some("null"), 403),
            ("origin", Some("https://127.0.0.1:80"), 403),
            ("origin", None, 403),
            ("sec-fetch-site", Some("cross-site"), 403),
            ("sec-fetch-site", Some("same-site"), 403),
            ("sec-fetch-site", Some("none"), 403),
            ("x-flexura-token", Some("Secret"), 403),
            ("x-flexura-token", Some(""), 403),
            ("x-flexura-token", None, 403),
            ("content-type", Some("text/plain"), 415),
        ] {
            assert_eq!(ask("POST", "/set", &but(name, value)), Err(status), "{name} {value:?}");
        }
        assert_eq!(
            ask("GET", "/events", &[("host", "localhost:80"), ("sec-fetch-site", "cross-site")]),
            Err(403)
        );
        assert_eq!(ask("GET", "/", &[("host", "localhost:80"), ("origin", "http://evil.example")]), Err(403));
        for path in
            ["/../a.mech", "/a.mech", "//", "/%2e%2e/etc/passwd", "/three.js/..", "http://evil/", "*", ""]
        {
            assert_eq!(ask("GET", path, &GOOD), Err(404), "{path}");
        }
        for (method, path) in
            [("GET", "/set"), ("POST", "/"), ("PUT", "/set"), ("OPTIONS", "/set"), ("HEAD", "/")]
        {
            assert_eq!(ask(method, path, &GOOD), Err(405), "{method} {path}");
        }
        let headers = GOOD.iter().map(|(n, v)| (n.to_string(), *v)).collect();
        let long = Asked { method: "POST", url: "/set", headers, body: Some(MOST_BODY + 1) };
        assert_eq!(admit(&long, 80, "secret").map_err(|e| e.0), Err(413));
        assert_eq!(admit(&Asked { body: None, ..long }, 80, "secret").map_err(|e| e.0), Err(413));
    }
}
