// What the browser or viser defines and TypeScript does not know.
interface Window {
  /** Set by page.js for the frame that viser's page is in. */
  katana?: { key(event: Event): void; blur(): void; toast(words: string): void; view: any };
  /** The state of viser's own client. */
  __viserMutable?: any;
}
interface Navigator {
  /** WebHID, which only some browsers have. */
  hid?: any;
}
