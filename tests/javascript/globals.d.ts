// What the browser or viser defines and TypeScript does not know.
interface Window {
  /** Set by page.js for the frame that viser's page is in. */
  katana?: { key(event: Event): void; blur(): void; toast(words: string): void; drawn(): void; used(): void; closeSheets(): void; live(): void; turned?(): void; entered?: Promise<URLSearchParams>; view: any };
  /** Set by frame.js in viser's page. */
  katanaScene?: { pixelOf(place: string | number[]): number[] | null; fold?(): void };
  /** The state of viser's own client. */
  __viserMutable?: any;
  /** The decoder of zstd that its program expects. */
  __viserZstdWasm?: WebAssembly.Module;
}
interface Navigator {
  /** WebHID, which only some browsers have. */
  hid?: any;
}
interface WindowEventMap {
  /** Sent by page.js with each status. */
  status: CustomEvent<any>;
}
