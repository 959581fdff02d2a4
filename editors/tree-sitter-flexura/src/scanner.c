// Where a statement ends: at the end of its line, before a `}` or at the end of the file, unless the next line goes on
// with an operator.
#include "tree_sitter/parser.h"

enum { END, NEVER };

void *tree_sitter_flexura_external_scanner_create(void) { return NULL; }
void tree_sitter_flexura_external_scanner_destroy(void *payload) { (void)payload; }
unsigned tree_sitter_flexura_external_scanner_serialize(void *payload, char *buffer) {
  (void)payload;
  (void)buffer;
  return 0;
}
void tree_sitter_flexura_external_scanner_deserialize(void *payload, const char *buffer, unsigned length) {
  (void)payload;
  (void)buffer;
  (void)length;
}

bool tree_sitter_flexura_external_scanner_scan(void *payload, TSLexer *lexer, const bool *valid) {
  (void)payload;
  // Both at once only while the parser looks for its way out of an error.
  if (!valid[END] || valid[NEVER]) return false;
  lexer->mark_end(lexer);
  lexer->result_symbol = END;
  bool line_ended = false;
  for (;;) {
    if (lexer->eof(lexer) || lexer->lookahead == '}') return true;
    switch (lexer->lookahead) {
      case '\n':
      case '\r':
        line_ended = true;
        lexer->advance(lexer, true);
        break;
      case ' ':
      case '\t':
        lexer->advance(lexer, true);
        break;
      case '/':
        lexer->advance(lexer, true);
        if (lexer->lookahead != '/') return false;
        while (!lexer->eof(lexer) && lexer->lookahead != '\n' && lexer->lookahead != '\r') {
          lexer->advance(lexer, true);
        }
        break;
      case '+':
      case '-':
      case '*':
      case '^':
      case '<':
      case '>':
      case '.':
        return false;
      default:
        return line_ended;
    }
  }
}
