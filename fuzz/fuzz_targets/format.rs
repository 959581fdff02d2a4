//! No text makes the parser panic or lose a byte, and the formatter neither fails nor changes its mind.
#![no_main]

use flexura::syntax::format::format;
use flexura::syntax::parse;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    assert_eq!(parse(0, text).tree.print(text), text);
    match format(0, text) {
        Ok(once) => {
            let twice = format(0, &once.text);
            assert_eq!(twice.map(|t| t.text).map_err(|e| e.message), Ok(once.text));
        }
        // Too large or nested too deep; anything else is a fault.
        Err(why) => assert!(matches!(why.code.as_str(), "E0005" | "E0006"), "{}: {text:?}", why.message),
    }
});
