// Names of viser's page: selectors of its elements, and colours. docs/viser.md lists them.
export const NUMBER_BOX = "input.mantine-NumberInput-input";
// Below this width the panel lies over the scene. Selectors of the panel's box, handle and content,
// and its colour.
export const NARROW = "(max-width: 36em)";
export const PANEL = '.mantine-Paper-root[style*="position: fixed"]';
export const PANEL_HANDLE = `${PANEL} [style*="height: 3.5em"]`;
export const PANEL_CONTENT = `${PANEL} [style*="width: 20em"]`;
export const PANEL_FOLD = "[role=button][aria-expanded]";
export const PANEL_GROUND = "var(--mantine-color-body)";
// The hint of a control, which lies over other ones.
export const HINT = "[role=tooltip]";
// Its notice that it draws by software, which would cover the scene. The banner says so where that makes the picture old.
export const SOFTWARE_NOTICE = "[role=alert][style*=orange]";
// viser draws faintly until the light of the room is loaded. If drawing takes as long as that, viser
// miscounts and the picture stays faint. It also starts with the light theme. Without controls from
// the server, as before each connection, its panel shows settings for developers. Its ground is that of the page.
export const STEADY = `canvas { opacity: 1 !important }
    :root { --mantine-color-body: light-dark(#fff, #1d232a) !important }
    html[data-theme=dark]:not([data-mantine-color-scheme=dark]) #root { opacity: 0 }
    html[data-loading] .mantine-Stack-root:has(> .mantine-TextInput-root) { visibility: hidden }`;
// Without transitions while nothing is drawn.
export const HELD = "html[data-held] * { transition: none !important }";
