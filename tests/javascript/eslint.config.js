import js from "@eslint/js";
import globals from "globals";

export default [
  // A library.
  { ignores: ["static/uplot/"] },
  js.configs.recommended,
  {
    files: ["static/**/*.js"],
    languageOptions: {
      ecmaVersion: 2024,
      sourceType: "module",
      globals: globals.browser,
    },
    rules: {
      eqeqeq: ["error", "always", { null: "ignore" }],
      "no-redeclare": ["error", { builtinGlobals: false }],
      "max-lines": ["error", 400],
      "max-lines-per-function": ["error", 80],
      "no-var": "error",
      "prefer-const": "error",
    },
  },
  // The worker.
  { files: ["static/link.js"], languageOptions: { sourceType: "script" } },
];
