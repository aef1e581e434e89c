"""Where specs are written: the language server, and grammars for language models. A leaf: the core does without it."""
