//! `flexura view` as a browser on this machine sees it, and as others do: what is refused, that every save arrives, that
//! errors are told and go away. How it looks and moves is the matter of `tests/external/check_view.mjs`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// One leaf; nothing is to be optimised, so that a page takes a moment.
const FLAP: &str = "use std.materials.petg
use std.processes.fdm
use std.flexures.leaf

mechanism flap {
    /// How far the arm reaches.
    param reach: length = 30 mm
    point O = (0 mm, 0 mm)
    point B = (-25 mm, 0 mm)
    point P = (reach, 0 mm)
    ground base { B, O }
    link   arm  { O, P }
    hinge bend: base to arm at O  into base toward B  into arm toward P  as leaf
    material petg
    print on fdm
    cycle 4 steps over 2 s
    drive bend from -10 deg to 10 deg
    trace tip = P on arm
}
";
/// Nothing that is waited for takes longer, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

struct View {
    child: Child,
    port: u16,
    token: String,
    dir: tempfile::TempDir,
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl View {
    fn of(text: &str) -> Self {
        Self::configured(text, "")
    }

    /// With a configuration beside the design.
    fn configured(text: &str, config: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        if !config.is_empty() {
            std::fs::write(dir.path().join("flexura.toml"), config).unwrap();
        }
        std::fs::write(dir.path().join("flap.mech"), text).unwrap();
        std::fs::write(dir.path().join("secret.txt"), "a secret").unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_flexura"))
            .args(["view", "flap.mech"])
            .current_dir(dir.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
        let port = address.trim().trim_end_matches('/').rsplit(':').next().unwrap().parse().unwrap();
        assert!(address.starts_with("http://127.0.0.1:"), "{address}");
        let mut view = Self { child, port, token: String::new(), dir };
        let page = view.get("/").body;
        view.token =
            page.split("name=\"flexura-token\" content=\"").nth(1).unwrap().split('"').next().unwrap().into();
        assert_eq!(view.token.len(), 48);
        view
    }

    fn path(&self) -> PathBuf {
        self.dir.path().join("flap.mech")
    }

    fn ask(&self, line: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut text = format!("{line} HTTP/1.1\r\nConnection: close\r\n");
        headers.iter().for_each(|(n, v)| text.push_str(&format!("{n}: {v}\r\n")));
        if !body.is_empty() {
            text.push_str(&format!("Content-Length: {}\r\n", body.len()));
        }
        stream.write_all(format!("{text}\r\n{body}").as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
        let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
        Answer { status, head: head.to_string(), body: body.to_string() }
    }

    fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    fn get(&self, path: &str) -> Answer {
        self.ask(&format!("GET {path}"), &[("Host", &self.host())], "")
    }

    fn post(&self, path: &str, body: &str) -> u16 {
        let origin = format!("http://{}", self.host());
        let headers = [
            ("Host", self.host()),
            ("Origin", origin),
            ("X-Flexura-Token", self.token.clone()),
            ("Content-Type", "application/json".into()),
        ];
        let headers: Vec<(&str, &str)> = headers.iter().map(|(n, v)| (*n, v.as_str())).collect();
        self.ask(&format!("POST {path}"), &headers, body).status
    }

    fn state(&self) -> Value {
        serde_json::from_str(&self.get("/state").body).unwrap()
    }

    /// Waits until the state is so.
    fn until(&self, what: &str, test: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        loop {
            let state = self.state();
            if test(&state) {
                return state;
            }
            assert!(began.elapsed() < PATIENCE, "{what}: {state}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until everything is made of what stands there now.
    fn settled(&self) -> Value {
        self.until("it settles", |s| s["phase"] == "" && s["version"].as_u64() > Some(0))
    }

    /// x of the far end of the arm in the page, mm.
    fn reach(&self) -> f64 {
        let page = self.get("/").body;
        let data = page.split("id=\"data\">").nth(1).unwrap().split("</script>").next().unwrap();
        let data: Value = serde_json::from_str(data).unwrap();
        let path = &data["traces"][0]["path"];
        // The box around its path: the largest x.
        path[2].as_f64().unwrap() + path[5].as_f64().unwrap()
    }
}

fn with_reach(mm: f64) -> String {
    FLAP.replace("30 mm", &format!("{mm} mm"))
}

/// A stream of events, as a browser reads it.
struct Events(BufReader<TcpStream>);

impl Events {
    fn of(view: &View) -> Self {
        let mut stream = TcpStream::connect(("127.0.0.1", view.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
            .write_all(format!("GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", view.host()).as_bytes())
            .unwrap();
        Self(BufReader::new(stream))
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        assert!(self.0.read_line(&mut line).unwrap() > 0, "the stream has ended");
        line.trim_end().to_string()
    }

    /// The next state that is so; lines between are those of the protocol.
    fn next(&mut self, test: impl Fn(&Value) -> bool) -> Value {
        loop {
            let line = self.line();
            if let Some(data) = line.strip_prefix("data: ") {
                let state: Value = serde_json::from_str(data).unwrap();
                if test(&state) {
                    return state;
                }
            }
        }
    }
}

#[test]
fn only_the_browser_of_this_machine_is_answered() {
    let view = View::of(FLAP);
    view.settled();
    let host = view.host();
    let good = view.get("/");
    assert_eq!(good.status, 200);
    assert!(
        good.head.contains("frame-ancestors 'none'") && good.head.contains("script-src 'self'"),
        "{}",
        good.head
    );
    assert!(!good.head.to_lowercase().contains("access-control"), "{}", good.head);
    assert!(
        !good.body.contains("http-equiv") && !good.body.contains("<script>"),
        "no script stands in the page"
    );
    for path in ["/three.js", "/report.js", "/live.js", "/live.css"] {
        assert_eq!(view.get(path).status, 200, "{path}");
    }
    for path in [
        "/../secret.txt",
        "/secret.txt",
        "/flap.mech",
        "/%2e%2e/secret.txt",
        "/..%2fsecret.txt",
        "//etc/passwd",
        "/live.js/../secret.txt",
    ] {
        let answer = view.get(path);
        assert!(answer.status == 404 && !answer.body.contains("secret"), "{path}: {}", answer.status);
    }
    for foreign in ["evil.example", "127.0.0.1", "localhost", &format!("evil.example:{}", view.port)] {
        for path in ["/", "/state", "/events"] {
            assert_eq!(
                view.ask(&format!("GET {path}"), &[("Host", foreign)], "").status,
                421,
                "{foreign}{path}"
            );
        }
    }
    let local = format!("localhost:{}", view.port);
    assert_eq!(view.ask("GET /", &[("Host", &local)], "").status, 200);
    for (name, value) in
        [("Origin", "http://evil.example"), ("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Site", "same-site")]
    {
        for path in ["/", "/state", "/events"] {
            assert_eq!(
                view.ask(&format!("GET {path}"), &[("Host", &host), (name, value)], "").status,
                403,
                "{name} {path}"
            );
        }
    }
    let (origin, json) = (format!("http://{host}"), "application/json");
    let set = "{\"name\": \"reach\", \"value\": \"40 mm\"}";
    let own = [
        ("Host", host.as_str()),
        ("Origin", &origin),
        ("X-Flexura-Token", &view.token),
        ("Content-Type", json),
    ];
    for (without, instead, status) in [
        ("Origin", "", 403),
        ("Origin", "http://evil.example", 403),
        ("Origin", "null", 403),
        ("X-Flexura-Token", "", 403),
        ("X-Flexura-Token", "0123", 403),
        ("Content-Type", "text/plain", 415),
        ("Host", "evil.example", 421),
    ] {
        let mut headers: Vec<(&str, &str)> = own.iter().copied().filter(|h| h.0 != without).collect();
        if !instead.is_empty() {
            headers.push((without, instead));
        }
        assert_eq!(view.ask("POST /set", &headers, set).status, status, "{without}: {instead}");
    }
    assert_eq!(view.ask("OPTIONS /set", &own, "").status, 405, "nobody is let in from elsewhere");
    assert_eq!(view.ask("GET /solve", &own, "").status, 405);
    assert_eq!(view.post("/set", "nonsense"), 400);
    assert_eq!(view.post("/set", "{\"name\": \"nothing\", \"value\": \"1\"}"), 404);
    assert_eq!(view.post("/set", &format!("{{\"name\": \"{}\", \"value\": \"1\"}}", "x".repeat(2000))), 413);
    assert!(view.state()["parameters"][0]["set"].is_null(), "none of these has set anything");
}

#[test]
fn saves_errors_and_sliders_arrive() {
    let view = View::of(FLAP);
    let mut events = Events::of(&view);
    assert!(events.line().contains("200 OK"));
    let first = events.next(|s| s["phase"] == "" && s["whole"] == true);
    let slider = &first["parameters"][0];
    assert_eq!(
        (slider["path"].as_str(), slider["doc"].as_str()),
        (Some("reach"), Some("How far the arm reaches."))
    );
    assert_eq!(slider["range"], serde_json::json!([15.0, 45.0, 0.2]));
    assert!((view.reach() - 30.0).abs() < 0.3, "{}", view.reach());
    let version = |s: &Value| s["version"].as_u64().unwrap();

    // A save.
    std::fs::write(view.path(), with_reach(34.0)).unwrap();
    let second = events.next(|s| version(s) > version(&first));
    assert!((view.reach() - 34.0).abs() < 0.3, "{}", view.reach());

    // A broken one: the page stays, and what is wrong is told with its place.
    std::fs::write(view.path(), FLAP.replace("(reach, 0 mm)", "(rich, 0 mm)")).unwrap();
    let fault = events.next(|s| !s["fault"].is_null());
    let told = fault["fault"].as_str().unwrap();
    assert!(told.contains("rich") && told.contains("flap.mech:10"), "{told}");
    assert!(version(&fault) >= version(&second) && (view.reach() - 34.0).abs() < 0.3, "the last good page");
    // And gone: the file itself.
    std::fs::remove_file(view.path()).unwrap();
    events.next(|s| s["fault"].as_str().is_some_and(|f| f.contains("E0730")));
    std::fs::write(view.path(), with_reach(34.0)).unwrap();
    let mended = events.next(|s| s["fault"].is_null() && version(s) > version(&fault));

    // A slider, and back; the file is not written.
    assert_eq!(view.post("/set", "{\"name\": \"reach\", \"value\": \"41 mm\"}"), 204);
    let set = events.next(|s| version(s) > version(&mended) && s["parameters"][0]["set"] == "41 mm");
    assert!((view.reach() - 41.0).abs() < 0.3, "{}", view.reach());
    assert_eq!(std::fs::read_to_string(view.path()).unwrap(), with_reach(34.0));
    assert_eq!(view.post("/set", "{\"name\": \"reach\", \"value\": \"1 kg\"}"), 204);
    events.next(|s| s["fault"].as_str().is_some_and(|f| f.contains("--set reach")));
    assert_eq!(view.post("/reset", "{}"), 204);
    events
        .next(|s| version(s) > version(&set) && s["fault"].is_null() && s["parameters"][0]["set"].is_null());
    assert!((view.reach() - 34.0).abs() < 0.3, "{}", view.reach());
    let names: Vec<String> = std::fs::read_dir(view.dir.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|n| !n.ends_with(".lock"))
        .collect();
    assert_eq!(names.len(), 2, "nothing is written but a lock: {names:?}");
}

/// Something to optimise, over so many steps.
fn optimised(mm: u32, steps: usize) -> String {
    let text = with_reach(f64::from(mm)).replace("cycle 4 steps", &format!("cycle {steps} steps"));
    let (body, _) = text.rsplit_once('}').unwrap();
    format!(
        "{body}    minimize {{ track(tip), stress(below = 0.1 MPa), torque(bend, scale = 0.01 N*mm) }}\n}}\n"
    )
}

/// `[build]` of the configuration counts as it does for `build`, and so do its mistakes.
#[test]
fn the_configuration_counts() {
    let solved = |config: &str| {
        let view = View::configured(&optimised(30, 4), config);
        let done = |s: &Value| s["phase"] == "" && s["stale"] == false && s["solving"]["running"] == false;
        let state = view.until("it is solved", done);
        let points = state["solving"]["points"].as_array().unwrap();
        points.iter().map(|p| p["n"].as_u64().unwrap()).max().unwrap()
    };
    assert!(solved("") > 1, "by itself it takes longer");
    assert_eq!(solved("[build]\niterations = 1\nthreads = 1\n"), 1);

    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("flap.mech"), FLAP).unwrap();
    std::fs::write(dir.path().join("flexura.toml"), "[build]\niterations = -1\n").unwrap();
    let mut refused = Command::new(env!("CARGO_BIN_EXE_flexura"));
    let refused = refused.args(["view", "flap.mech"]).current_dir(dir.path()).output().unwrap();
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && told.contains("E0740"), "{told}");
}

/// The optimiser's progress is told, a newer save ends it, and what was found until then is where the next one begins.
#[test]
fn a_save_ends_an_optimisation() {
    let slow = |mm: u32| optimised(mm, 40);
    let view = View::of(&slow(30));
    let mut events = Events::of(&view);
    let running = |s: &Value| {
        s["solving"]["running"] == true && s["solving"]["points"].as_array().is_some_and(|p| !p.is_empty())
    };
    let state = events.next(|s| running(s) || s["version"].as_u64() > Some(1));
    assert!(running(&state), "{state}");
    let point = &state["solving"]["points"][0];
    assert!(
        point["cost"].as_f64().unwrap() > 0.0 && point["terms"].as_array().unwrap().len() >= 3,
        "{point}"
    );
    let began = Instant::now();
    std::fs::write(view.path(), slow(36)).unwrap();
    // Pages are there at once, whoever is at work.
    assert_eq!(view.get("/").status, 200);
    assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
    let settled =
        view.until("it is solved", |s| s["phase"] == "" && s["stale"] == false && s["fault"].is_null());
    assert_eq!(settled["solving"]["running"], false);
    assert!((view.reach() - 36.0).abs() < 0.6, "{}", view.reach());
    let lock = std::fs::read_to_string(view.dir.path().join("flap.lock")).unwrap();
    assert!(lock.contains("\nhistory 0 ") && lock.contains("\nterm track(tip) "), "{lock}");
}

/// Bytes that the process holds.
fn memory(child: &Child) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find(|l| l.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kb| kb * 1024)
}

/// Saves as editors save: in place, by another file that takes its place, in several writes, several at once; every so often
/// one is broken. Afterwards the page shows the last text.
fn saves(view: &View, count: usize, pause: Duration) {
    let path: &Path = &view.path();
    let mut first = None;
    for k in 0..count {
        let good = with_reach(20.0 + (k % 40) as f64 * 0.5);
        let text = match k % 7 {
            3 => good.replace("param reach", "param"),
            5 => good[..good.len() / 2].to_string(),
            6 => String::new(),
            _ => good,
        };
        match k % 4 {
            0 => std::fs::write(path, &text).unwrap(),
            1 => {
                let other = path.with_extension("mech~");
                std::fs::write(&other, &text).unwrap();
                std::fs::rename(&other, path).unwrap();
            }
            2 => {
                let mut file = std::fs::File::create(path).unwrap();
                for piece in text.as_bytes().chunks(200) {
                    file.write_all(piece).unwrap();
                    file.flush().unwrap();
                }
            }
            _ => {
                std::fs::write(path, "mechanism").unwrap();
                std::fs::write(path, &text).unwrap();
            }
        }
        std::thread::sleep(pause);
        if k == count / 4 {
            first = memory(&view.child);
        }
    }
    let last = memory(&view.child);
    std::fs::write(path, with_reach(37.5)).unwrap();
    let settled = view.until("the last text is shown", |s| {
        s["phase"] == "" && s["fault"].is_null() && s["parameters"][0]["value"] == 37.5
    });
    assert!((view.reach() - 37.5).abs() < 0.3, "{}", view.reach());
    assert!(settled["version"].as_u64().unwrap() > 1);
    if let (Some(first), Some(last)) = (first, last) {
        println!("{} kB after a quarter, {} kB at the end", first / 1024, last / 1024);
        // A page is about a megabyte: if something of every save stayed, it would be hundreds.
        assert!(last < first + 60_000_000, "{first} bytes became {last}");
    }
}

#[test]
fn many_saves_leave_the_last_one() {
    let view = View::of(FLAP);
    view.settled();
    let _watching = Events::of(&view);
    saves(&view, 40, Duration::from_millis(20));
}

#[test]
fn a_thousand_saves_leave_the_last_one() {
    if std::env::var_os("FLEXURA_EXTENDED").is_none() {
        eprintln!("skipped: FLEXURA_EXTENDED is not set");
        return;
    }
    let view = View::of(FLAP);
    view.settled();
    let _watching: Vec<Events> = (0..3).map(|_| Events::of(&view)).collect();
    saves(&view, 1000, Duration::from_millis(30));
    assert_eq!(view.ask("GET /", &[("Host", "evil.example")], "").status, 421);
}
