//! The server: loopback only, fixed routes, one small thread a stream.

use super::engine::Engine;
use super::guard::{Asked, MOST_BODY, Route, admit};
use flexura::emit::report::live::{self, Addition};
use serde::Deserialize;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tiny_http::{Header, Request, Response, Server};

/// Streams at a time: more tabs than anybody looks at.
const MOST_STREAMS: usize = 32;
/// A sign of life goes out so often where nothing else does.
const ALIVE: Duration = Duration::from_secs(5);
/// Between two states: more than a screen shows are not sent.
const PACE: Duration = Duration::from_millis(30);
/// What a page may load: what comes from here.
const POLICY: &str = "default-src 'none'; style-src 'self' 'unsafe-inline'; script-src 'self'; img-src data:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What is served, and to whom.
pub struct Service {
    server: Server,
    engine: Arc<Engine>,
    port: u16,
    token: String,
    streams: Arc<AtomicUsize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    name: String,
    value: String,
}

impl Service {
    /// Binds a port of 127.0.0.1; 0: any that is free.
    ///
    /// # Errors
    /// Where it cannot be had, or the system has no random numbers for the token.
    pub fn new(engine: Arc<Engine>, port: u16) -> Result<Self, String> {
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let server = Server::http(address).map_err(|e| format!("cannot serve at {address}: {e}"))?;
        let port = server.server_addr().to_ip().map_or(port, |a| a.port());
        let mut bytes = [0_u8; 24];
        getrandom::fill(&mut bytes).map_err(|e| format!("no random numbers: {e}"))?;
        let token = bytes.iter().map(|b| format!("{b:02x}")).collect();
        Ok(Self { server, engine, port, token, streams: Arc::default() })
    }

    /// Where it is.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Answers until the process ends.
    pub fn run(&self) {
        for request in self.server.incoming_requests() {
            self.answer(request);
        }
    }

    fn answer(&self, mut request: Request) {
        let method = request.method().to_string();
        let url = request.url().to_string();
        let given: Vec<(String, String)> = request
            .headers()
            .iter()
            .map(|h| (h.field.to_string().to_ascii_lowercase(), h.value.to_string()))
            .collect();
        let headers = given.iter().map(|(n, v)| (n.clone(), v.as_str())).collect();
        let asked = Asked { method: &method, url: &url, headers, body: request.body_length() };
        match admit(&asked, self.port, &self.token) {
            Err((status, why)) => reply(request, status, "text/plain", format!("{why}\n").into_bytes()),
            Ok(Route::Events) => self.stream(request),
            Ok(Route::Page) => {
                let page = self.page();
                // A reader that is slow keeps nobody else waiting.
                std::thread::spawn(move || reply(request, 200, "text/html", page.into_bytes()));
            }
            Ok(Route::Three) => reply(request, 200, "text/javascript", live::THREE.into()),
            Ok(Route::Report) => reply(request, 200, "text/javascript", live::SCRIPT.into()),
            Ok(Route::Live) => {
                reply(request, 200, "text/javascript", include_bytes!("page/live.js").to_vec())
            }
            Ok(Route::Style) => reply(request, 200, "text/css", include_bytes!("page/live.css").to_vec()),
            Ok(Route::State) => {
                let state = self.engine.next(u64::MAX, Duration::ZERO).map(|s| s.1).unwrap_or_default();
                reply(request, 200, "application/json", state.into_bytes());
            }
            Ok(Route::Set) => {
                let mut body = Vec::new();
                // It has come already: bodies of this length are read with the head.
                let read = request.as_reader().take(MOST_BODY as u64).read_to_end(&mut body);
                let set = read.ok().and_then(|_| serde_json::from_slice::<Set>(&body).ok());
                match set {
                    None => reply(request, 400, "text/plain", b"{\"name\": ..., \"value\": ...}\n".to_vec()),
                    Some(set) if self.engine.set(&set.name, &set.value) => done(request),
                    Some(_) => reply(request, 404, "text/plain", b"there is no such parameter\n".to_vec()),
                }
            }
            Ok(Route::Reset) => {
                self.engine.reset();
                done(request);
            }
            Ok(Route::Solve) => {
                self.engine.solve();
                done(request);
            }
            Ok(Route::Stop) => {
                self.engine.stop();
                done(request);
            }
        }
    }

    fn page(&self) -> String {
        let (version, page) = self.engine.page();
        let head = format!(
            "<meta name=\"flexura-token\" content=\"{}\">\n<meta name=\"flexura-version\" content=\"{version}\">\n<link rel=\"stylesheet\" href=\"/live.css\">",
            self.token
        );
        match page {
            Some(page) => {
                let bench = include_str!("page/bench.html").to_string();
                let scripts = ["/three.js", "/report.js", "/live.js"].map(String::from);
                live::served(&page, &Addition { head, bench, scripts })
            }
            None => include_str!("page/wait.html").replacen("<!-- head -->", &head, 1),
        }
    }

    /// Server-sent events: the state, whenever it has changed.
    fn stream(&self, request: Request) {
        if self.streams.fetch_add(1, Ordering::SeqCst) >= MOST_STREAMS {
            self.streams.fetch_sub(1, Ordering::SeqCst);
            return reply(request, 503, "text/plain", b"too many windows\n".to_vec());
        }
        let (engine, streams) = (Arc::clone(&self.engine), Arc::clone(&self.streams));
        std::thread::spawn(move || {
            let mut out = request.into_writer();
            let mut head = String::from("HTTP/1.1 200 OK\r\nConnection: close\r\n");
            for (name, value) in fixed("text/event-stream") {
                head.push_str(&format!("{name}: {value}\r\n"));
            }
            let mut send = |text: &str| out.write_all(text.as_bytes()).and_then(|()| out.flush()).is_ok();
            let mut open = send(&format!("{head}\r\nretry: 500\n\n"));
            let mut last = u64::MAX;
            while open && !engine.has_ended() {
                open = match engine.next(last, ALIVE) {
                    Some((serial, state)) => {
                        last = serial;
                        send(&format!("event: state\ndata: {state}\n\n"))
                    }
                    None => send(":\n\n"),
                };
                std::thread::sleep(PACE);
            }
            streams.fetch_sub(1, Ordering::SeqCst);
        });
    }
}

/// Headers of every answer.
fn fixed(kind: &str) -> Vec<(&'static str, String)> {
    vec![
        ("Content-Type", format!("{kind}; charset=utf-8")),
        ("Content-Security-Policy", POLICY.into()),
        ("X-Content-Type-Options", "nosniff".into()),
        ("X-Frame-Options", "DENY".into()),
        ("Referrer-Policy", "no-referrer".into()),
        ("Cross-Origin-Resource-Policy", "same-origin".into()),
        ("Cross-Origin-Opener-Policy", "same-origin".into()),
        ("Cache-Control", "no-store".into()),
    ]
}

fn done(request: Request) {
    reply(request, 204, "text/plain", Vec::new());
}

/// Answers; a reader that went away is no matter.
fn reply(request: Request, status: u16, kind: &str, body: Vec<u8>) {
    let mut response = Response::from_data(body).with_status_code(status).with_chunked_threshold(usize::MAX);
    for (name, value) in fixed(kind) {
        if let Ok(header) = Header::from_bytes(name, value) {
            response.add_header(header);
        }
    }
    let _ = request.respond(response);
}
