// Types of the page that no class of the server gives: its status, the objects that its parts exchange, and what it
// uses of viser and three.js.
declare namespace Page {
  type Pixel = [number, number];
  type Vector = [number, number, number];
  type Say = (request: Api.Act) => void;
  type Toast = (words: string) => void;

  type Store = import("../../static/page/store.js").Store;

  /** A storage of the browser; see `page/storage.js`. */
  interface Kept { getItem(name: string): string | null; setItem(name: string, value: string): void; }

  /** What every part of the page gets. */
  interface Context {
    store: Store; say: Say; toast: Toast;
    kept: Kept;
    /** The frame of viser's page, the element round it, and the name of this page. */
    scene: HTMLIFrameElement; stage: HTMLElement; name: string;
    /** The moment of a recording that the scene shows; null while it shows the present. */
    past: { of: string, t: number } | null;
  }

  /** What viser's page offers to this one. */
  type Scene = typeof import("../../static/viser/names.js") & typeof import("../../static/viser.js") & typeof import("../../static/fit.js") & { fold?(): void };

  /** A camera; whether a person may share one of their machine as it. */
  interface Camera { name: string; shared: boolean; }

  interface Named { number: number; name: string; }

  /** What the server says about the arm and the lease; see `server/service/status.py`. */
  interface Status {
    mood: string; headline: string; why: string; end: string;
    stop: string | null; stopped: string | null; stopped_at: number | null;
    wait: string; problem: string | null; holder: string | null; silence_profile: string;
    speed: number; step_speed: boolean; paused: boolean; arm: ArmStatus | null; participants: number; revocations: number; scripts: boolean;
    pace: string; may_clear_stop: boolean; until: string; name: string; role: string; mine: boolean;
    own_program: boolean; asked: boolean; asking: Named[]; others: Named[]; planning: boolean;
    fraction: number; orders: (Api.ProgramOrder | "keep")[]; driven_since?: number; continues: [] | [string, number, number]; age: number;
    /** Names of what can be undone and redone, the newest first. */
    undo?: string[]; redo?: string[];
    clearance: Clearance | null;
    cautions?: string; episodes?: EpisodesState | null; robot?: Robot | null;
    cameras?: Camera[];
  }

  /** The two nearest parts: their distance [mm], and the nearest point of each in m of viser's world. */
  interface Clearance { distance: number; parts: [string, string]; points: [Vector, Vector]; }

  /** The robot that the server drives; see `extensions/robot_choice/choose_robot.py`. */
  interface Robot { name: string; key: string; loading: string | null; problem: string; }

  /** What a page shows of a real arm: angles in degrees, times in s. */
  interface ArmStatus {
    mode: string; note: string; acts: Partial<Record<Api.ArmAct, string>>; lag: number; error: number; age: number; round_trip: number;
    /** Time [s], angle [degrees] and way of the tool [m] of the last stop. */
    stop: [number, number, number | null] | null;
  }

  interface StatusMessage extends Partial<Status> { is: "status"; id?: undefined; }
  interface StoppedMessage { is: "stopped"; id?: undefined; }
  type Answer = Api.Answer | StatusMessage | StoppedMessage;

  /** A message of the worker `link.js`. */
  interface LinkEvent {
    link?: "up" | "down"; code?: number; trip?: number; silent?: number; unsaid?: Api.Act["do"]; heard?: Answer; took?: number;
  }

  /** A message to it: a request, the address to open, the rate of states [Hz], or that a person acts. */
  interface Order { say?: Api.Act; open?: string; watch?: number; used?: boolean; }

  interface LastEpisode { number: number; outcome: Outcome; seconds: number; missing_ticks: number; }
  type Outcome = "success" | "failure" | "unjudged" | "unfinished";
  interface EpisodesState {
    revision: number; running: { number: number; seconds: number; bytes: number; left: number | null; by: string } | null;
    saving: number | null; count: number; task: string; last: LastEpisode | null;
    problem: string; notice: string;
  }

  /** A view of the camera, in m of viser's world. */
  interface View { position: number[]; look_at: number[]; }
}

/** The parts of three.js that the page uses. */
declare namespace Three {
  interface Vector3 {
    x: number; y: number; z: number;
    clone(): Vector3; set(x: number, y: number, z: number): this; sub(v: Vector3): this; add(v: Vector3): this;
    dot(v: Vector3): number; cross(v: Vector3): this; normalize(): this; negate(): this; length(): number;
    setLength(length: number): this; multiplyScalar(factor: number): this; addScaledVector(v: Vector3, factor: number): this;
    applyMatrix4(m: Matrix4): this; transformDirection(m: Matrix4): this; setFromMatrixPosition(m: Matrix4): this;
    project(camera: Camera): this; unproject(camera: Camera): this; toArray(): Page.Vector;
  }
  interface Vector2 { clone(): Vector2; set(x: number, y: number): this; }
  interface Quaternion { x: number; y: number; z: number; w: number; clone(): Quaternion; setFromRotationMatrix(m: Matrix4): this; multiply(q: Quaternion): this; setFromAxisAngle(axis: Vector3, angle: number): this; }
  interface Matrix4 { elements: number[]; clone(): Matrix4; invert(): this; multiply(m: Matrix4): this; copy(m: Matrix4): this; }
  interface Colour { set(colour: number | string): void; lerp(colour: Colour, fraction: number): void; }
  interface Material { clone(): Material; dispose(): void; color: Colour; opacity: number; emissive?: Colour; emissiveIntensity: number; }
  interface Geometry {
    attributes?: { position?: object }; boundingBox: { min: Vector3; max: Vector3 } | null; computeBoundingBox(): void;
  }
  interface Object3D {
    name: string; type: string; visible: boolean; parent: Object3D | null; children: Object3D[];
    position: Vector3; quaternion: Quaternion; matrix: Matrix4; matrixWorld: Matrix4; matrixAutoUpdate: boolean;
    castShadow: boolean; receiveShadow: boolean;
    clone(recursive?: boolean): Object3D; add(child: Object3D): void; removeFromParent(): void; updateMatrix(): void;
    updateWorldMatrix(parents: boolean, children: boolean): void; worldToLocal(v: Vector3): Vector3;
    getWorldPosition(v: Vector3): Vector3; traverse(visit: (object: Object3D) => void): void; traverseVisible(visit: (object: Object3D) => void): void;
    geometry?: Geometry; __r3f?: { handlers?: { onPointerDown?: object } };
  }
  interface Mesh extends Object3D { isMesh: true; material: Material; }
  interface Camera extends Object3D { fov: number; matrixWorldInverse: Matrix4; }
  interface Hit { object: Object3D; point: Vector3; }
  interface Raycaster {
    constructor: new () => Raycaster;
    setFromCamera(pointer: Vector2, camera: Camera): void; intersectObjects(objects: Object3D[], recursive: boolean): Hit[];
  }
  interface Renderer { render(scene: Object3D, camera: Camera): void; getRenderTarget(): object | null; }
  interface Root { raycaster: Raycaster; pointer: Vector2; internal: { interaction: Object3D[] }; gl: Renderer; }
  interface Scene extends Object3D { __r3f: { root: { getState(): Root }; handlers?: { onPointerDown?: object } }; }
  interface Controls {
    getPosition(v: Vector3): Vector3; getTarget(v: Vector3): Vector3;
    setPosition(x: number, y: number, z: number, animated: boolean): void;
    setTarget(x: number, y: number, z: number, animated: boolean): void;
  }
}

/** The parts of viser's page that the page uses; docs/viser.md lists them. */
declare namespace ViserPage {
  interface Viewer {
    camera: Three.Camera; cameraControl: Three.Controls; canvas: HTMLCanvasElement; scene: Three.Scene;
    nodeRefFromName: Record<string, Three.Object3D | undefined>;
    firstMessageBatch: boolean; messageQueue: object[]; requestRender(): void;
  }

  /** A message between viser's page and its server; a type has some of the fields. */
  interface Message {
    type: string; uuid?: string; name?: string; visible?: boolean; props?: ControlProps; updates?: ControlProps;
    position?: number[]; wxyz?: number[]; look_at?: number[]; initial?: boolean; count?: number;
    dark_mode?: boolean; rgb_data?: Uint8Array; made?: number;
  }
  interface ControlProps { label?: string; value?: string; step?: number; min?: Limit; max?: Limit; }
  type Limit = number | number[] | null;

  /** The camera of a message of the page. */
  type View = Message & { position: number[]; look_at: number[]; };

  /** A connection between viser's page and its server. */
  interface Connection { say(message: Message): void; show(messages: Message[]): void; }

  interface Theme { dark: boolean; sky: string; cell_color: number[]; section_color: number[]; plane_color: number[]; shadow_opacity: number; }
}

// What the browser or viser defines and TypeScript does not know.
interface Window {
  /** Set by language/translator.js: returns a text in the language of the page. */
  translated?: (words: string) => string;
  /** Set by page.js for the frame that viser's page is in. */
  katana?: {
    key(event: KeyboardEvent): void; blur(): void; toast(words: string): void; drawn(): void; used(): void;
    closeSheets(): void; live(): void; turned?(): void; dragged?(message: ViserPage.Message): void; entered?: Promise<URLSearchParams>;
  };
  /** Set by frame.js in viser's page. */
  katanaScene?: Page.Scene;
  /** The state of viser's own client. */
  __viserMutable?: ViserPage.Viewer;
  /** The decoder of zstd that its program expects. */
  __viserZstdWasm?: WebAssembly.Module;
}
interface HidDevice extends EventTarget { opened: boolean; productName: string; open(): Promise<void>; }
interface HidReport extends Event { reportId: number; data: DataView; }
interface Navigator {
  /** WebHID, which only some browsers have. */
  hid?: { getDevices(): Promise<HidDevice[]>; requestDevice(options: { filters: object[] }): Promise<HidDevice[]> };
}
