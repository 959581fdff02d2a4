//! Elaboration: what the texts become, and what is said about texts that are wrong.

use flexura::elaborate::{Elaborated, Options, elaborate};
use std::collections::BTreeMap;

const CHEBYSHEV: &str = include_str!("../examples/chebyshev/chebyshev.mech");

fn run(text: &str) -> Elaborated {
    run_with(text, &Options::default())
}

fn run_with(text: &str, options: &Options) -> Elaborated {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    elaborate("main.mech", &files, options)
}


#[test]
fn dump() {
    let text = std::fs::read_to_string(std::env::var("MECH").unwrap()).unwrap();
    let e = run(&text);
    for d in &e.diagnostics {
        let o = d.labels[0].at;
        let f = &e.sources.files[o.file as usize];
        let line = f.text[..o.start as usize].matches('\n').count() + 1;
        println!("{}:{} {} {} [{}] «{}» help={:?}", f.name, line, d.code, d.message, d.labels[0].text, &f.text[o.start as usize..o.end as usize], d.help);
        for l in &d.labels[1..] {
            let f = &e.sources.files[l.at.file as usize];
            println!("      «{}» {}", &f.text[l.at.start as usize..l.at.end as usize], l.text);
        }
    }
}
