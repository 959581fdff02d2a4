//! The `flexura` command.
fn main() {}
