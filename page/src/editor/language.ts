// Colours for specs: a small tokenizer. What a text means comes from the server.
import { HighlightStyle, LanguageSupport, StreamLanguage, syntaxHighlighting } from "@codemirror/language";
import { tags } from "@lezer/highlight";

const STATEMENTS = new Set(["workspace", "object", "region", "const", "def", "require", "import"]);
const WORDS = new Set(["forall", "exists", "in", "and", "or", "not", "implies", "at"]);
// Words of time are names in specs without: they are operators where a formula or a window follows.
const TIMES = new Set(["always", "eventually", "until", "until_with", "next", "initially", "finally"]);
const ATOMS = new Set(["true", "false", "objects", "workspace", "NORTH", "EAST", "SOUTH", "WEST"]);

const spec = StreamLanguage.define<{ after: string }>({
  name: "spec",
  startState: () => ({ after: "" }),
  token(stream, state) {
    if (stream.eatSpace()) return null;
    if (stream.match(/^#.*/)) return "comment";
    if (stream.match(/^"[^"]*"?/)) return "string";
    if (stream.match(/^\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?:\s*(?:(?:(?:mm|cm|m|rad|deg|turn)(?:\/s)?|s|ms|min|steps?)\b|%))?/)) {
      state.after = "";
      return "number";
    }
    if (stream.match(/^[A-Za-z_]\w*/)) {
      const word = stream.current();
      const before = state.after;
      state.after = word;
      if (before === "." ) return "propertyName";
      if (STATEMENTS.has(word) && !(word === "workspace" && !stream.sol() && stream.column() > 0)) return "keyword";
      if ((word === "time" && stream.column() === 0 && stream.match(/^\s*[\d[]/, false)) || (word === "usually" && stream.match(/^\s+[^#]*~/, false)) || ((word === "robot" || word === "camera") && stream.match(/^\s+[A-Za-z_]\w*\s*[=\[]/, false)) || (word === "moves" && stream.column() === 0 && stream.match(/^\s*(one|all)\b/, false))) return "keyword";
      if (TIMES.has(word) && stream.match(/^\s*[[(!¬A-Za-z]/, false)) return "operatorKeyword";
      if (WORDS.has(word) || (word === "looks" && stream.match(/^\s+at\b/, false)) || (word === "fov" && stream.match(/^\s+[\d(A-Za-z_]/, false))) return "operatorKeyword";
      if (before === "def") return "definition";
      if (stream.match(/^\s*:(?!=)/, false) && stream.column() === 0) return "labelName";
      if (stream.match(/^\s*\(/, false)) return "function";
      if (ATOMS.has(word) || /^[A-Z][A-Z0-9_]*$/.test(word)) return "atom";
      return "variableName";
    }
    const sign = stream.next() ?? "";
    state.after = sign;
    return "&|!¬∧∨→⊤⊥∀∃≤≥<>=+-*/".includes(sign) ? "operator" : "punctuation";
  },
  tokenTable: {
    definition: tags.definition(tags.function(tags.variableName)),
    function: tags.function(tags.variableName),
  },
  languageData: { commentTokens: { line: "#" } },
});

const colours = HighlightStyle.define([
  { tag: tags.comment, color: "var(--code-comment)", fontStyle: "italic" },
  { tag: tags.string, color: "var(--code-string)" },
  { tag: tags.number, color: "var(--code-number)" },
  { tag: tags.keyword, color: "var(--code-keyword)", fontWeight: "600" },
  { tag: tags.operatorKeyword, color: "var(--code-keyword)" },
  { tag: tags.function(tags.variableName), color: "var(--code-function)" },
  { tag: tags.definition(tags.function(tags.variableName)), color: "var(--code-function)", fontWeight: "600" },
  { tag: tags.labelName, color: "var(--code-label)", fontWeight: "700" },
  { tag: tags.atom, color: "var(--code-atom)" },
  { tag: tags.propertyName, color: "var(--code-atom)" },
  { tag: tags.operator, color: "var(--code-operator)" },
]);

export const specLanguage = () => new LanguageSupport(spec, [syntaxHighlighting(colours)]);
