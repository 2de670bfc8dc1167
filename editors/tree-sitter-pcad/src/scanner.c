// The tokens of addresses that need a look at the character after them.

#include "tree_sitter/parser.h"

enum { SEPARATOR, RECOVERING };

static bool starts_segment(int32_t c) {
  return ('a' <= c && c <= 'z') || ('A' <= c && c <= 'Z') || c == '_' || c == '*';
}

void *tree_sitter_pcad_external_scanner_create(void) { return NULL; }

void tree_sitter_pcad_external_scanner_destroy(void *payload) { (void)payload; }

unsigned tree_sitter_pcad_external_scanner_serialize(void *payload, char *buffer) {
  (void)payload;
  (void)buffer;
  return 0;
}

void tree_sitter_pcad_external_scanner_deserialize(void *payload, const char *buffer, unsigned n) {
  (void)payload;
  (void)buffer;
  (void)n;
}

// `@a/b` is one address, `@a/2` and `@a / b` are divisions, `@a..b` is a range.
bool tree_sitter_pcad_external_scanner_scan(void *payload, TSLexer *lexer, const bool *valid) {
  (void)payload;
  if (valid[RECOVERING] || !valid[SEPARATOR]) {
    return false;
  }
  if (lexer->lookahead != '/' && lexer->lookahead != '.') {
    return false;
  }
  lexer->advance(lexer, false);
  lexer->mark_end(lexer);
  lexer->result_symbol = SEPARATOR;
  return starts_segment(lexer->lookahead);
}
