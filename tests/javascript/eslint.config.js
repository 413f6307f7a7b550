import js from "@eslint/js";
import globals from "globals";

// Defined at the top of one script of a document and used by the others.
const shared = {
  Edit: "readonly", Fields: "readonly", Fit: "readonly", Jog: "readonly", More: "readonly", Objects: "readonly", Pace: "readonly", Theme: "readonly", Viser: "readonly",
};

export default [
  js.configs.recommended,
  {
    files: ["static/**/*.js"],
    languageOptions: {
      ecmaVersion: 2024,
      sourceType: "script",
      globals: { ...globals.browser, ...shared },
    },
    rules: {
      eqeqeq: ["error", "always", { null: "ignore" }],
      "no-redeclare": ["error", { builtinGlobals: false }],
      "no-unused-vars": ["error", { vars: "local" }],
      "no-var": "error",
      "prefer-const": "error",
    },
  },
  { files: ["static/{arm,episodes,instruments,jog,more,objects,people,scene,selection,sheet,teach,timeline,touch,welcome}/*.js"], languageOptions: { sourceType: "module" } },
];
