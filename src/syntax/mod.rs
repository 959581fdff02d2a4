//! Text to tree. The only client of pest.

pub mod ast;
