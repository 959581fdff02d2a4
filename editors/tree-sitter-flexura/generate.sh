#!/usr/bin/env bash
# Makes src/ of grammar.js; needs tree-sitter's command (`cargo install tree-sitter-cli --locked`). What it makes is checked
# in, so that editors need no more than a C compiler. ABI 14 is what editors of the last years all read.
set -euo pipefail
cd "$(dirname "$0")"
tree-sitter generate --abi 14 grammar.js
sha256sum grammar.js >src/made-of.sha256
