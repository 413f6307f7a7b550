// Written by `python -m docs.page_types` from the classes of the acts and answers.
declare namespace Api {
  interface Acquire { do: "acquire"; id?: number | string | null; revocations?: number | null; made?: number | null; }
  type Act = Acquire | Ask | Attach | Branch | Breakpoints | ChooseRobot | ClearStop | ContinueFrom | Decline | EndDrag
    | Fill | Get | Give | GoToZero | Gripper | Heartbeat | Hello | Hold | Home | Jog | Joint | Joints | Load | Nudge |
    OperateArm | Orient | Pause | Place | Pose | Position | Preview | Program | Query | Redo | ReleaseLease | Remove |
    Rename | Resume | Servo | Set | SetPriority | Speed | Steer | StepTool | Stop | Take | Tool | Turn | TurnElbow |
    Undo | Watch | Withdraw;
  type Answer = Arm | Branches | Done | Echo | Loop | Mesh | Objects | ProgramPlan | Refused | Scene | State | Values |
    Welcome | World;
  interface Arm { is: "arm"; id?: number | string | null; name: string; joints: string[]; lower: number[];
    upper: number[]; speed: number[]; acceleration: number[]; jerk: number[]; ready: number[];
    tools: Record<string, number[][]>; default_tool: string | null; gripper: [number, number, number] | null;
    gripper_slides: boolean; suction_cup: boolean; T_base_shoulder: number[][] | null; slides: boolean[];
    links: JointLink[]; joints_only: string; freedoms?: number; turns_elbow?: boolean; }
  type ArmAct = "calibrate" | "connect" | "disconnect" | "engage" | "release" | "unblock";
  interface Ask { do: "ask"; id?: number | string | null; revocations?: number | null; made?: number | null; }
  interface Attach { do: "attach"; name: string; to: Attachment; T?: number[][] | null; id?: number | string | null;
    revocations?: number | null; made?: number | null; }
  type Attachment = "hand" | "world";
  interface Branch { do: "branch"; name: string; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface BranchOption { name: string; shoulder: string | null; elbow: string | null; q: number[];
    within_limits: boolean; position_error: number; rotation_error: number; distance: number; time: number;
    smallest_singular_value: number; contact: [string, string] | null; refusal: string; }
  interface Branches { is: "branches"; id?: number | string | null; choices: BranchOption[]; }
  interface Breakpoints { do: "breakpoints"; id?: number | string | null; revocations?: number | null;
    made?: number | null; steps: number[]; }
  interface Choice { name: string; title: string; kind: string; maker?: string; licence?: string;
    arguments?: Record<string, string>; }
  interface Choices { robots: Choice[]; }
  interface ChooseRobot { do: "choose_robot"; robot: string; arguments?: Record<string, string> | null;
    id?: number | string | null; revocations?: number | null; made?: number | null; }
  interface ClearStop { do: "clear_stop"; id?: number | string | null; revocations?: number | null;
    made?: number | null; }
  interface ContinueFrom { do: "continue_from"; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; t: number; of?: string; }
  interface Decline { do: "decline"; id?: number | string | null; revocations?: number | null; made?: number | null;
    to: number; }
  interface Done { is: "done"; id?: number | string | null; ticket?: number | null; outcome?: string | null;
    findings?: Finding[]; refused?: PartRefusal[]; rotation_misfit?: number | null; revocations?: number | null;
    end?: MotionEnd | null; }
  interface Echo { is: "echo"; id?: number | string | null; n: number; }
  interface EndDrag { do: "end_drag"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Field { field: string; type: string; value: number | number[]; settable: boolean; }
  interface FieldName { node: string; field: string; }
  interface FieldSetting { node: string; field: string; value: number[]; }
  interface Fill { do: "fill"; ml: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; }
  interface Finding { reason: string; text: string; amount: number | null; unit: string | null; axis: number | null;
    parts: [string, string] | null; }
  interface FingerForce { finger: string; force: number; }
  type Frame = "base" | "shoulder";
  interface Get { do: "get"; id?: number | string | null; revocations?: number | null; made?: number | null;
    node: string; field: string; more?: FieldName[]; }
  interface Give { do: "give"; id?: number | string | null; revocations?: number | null; made?: number | null;
    to: number; }
  interface GoToZero { do: "go_to_zero"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Gripper { do: "gripper"; angle: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface Heartbeat { do: "heartbeat"; id?: number | string | null; revocations?: number | null; made?: number | null;
    n?: number; }
  interface Hello { do: "hello"; id?: number | string | null; revocations?: number | null; made?: number | null;
    name: string; token?: string; }
  interface Hold { do: "hold"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Home { do: "home"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Jog { do: "jog"; rates: number[]; frame?: JogFrame; id?: number | string | null;
    revocations?: number | null; made?: number | null; }
  type JogFrame = "base" | "tool";
  interface Joint { do: "joint"; axis: number; value: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface JointLink { label: string; path: string[]; axis: number[]; }
  interface Joints { do: "joints"; q: number[]; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface Load { do: "load"; id?: number | string | null; revocations?: number | null; made?: number | null;
    scene: string; }
  interface Loop { is: "loop"; id?: number | string | null; period: number; ticks: number; late_p50: number;
    late_p99: number; late_max: number; lost: number; }
  interface Margins { limit: number; axis: number; limits: number[]; smallest_singular_value: number;
    clearance: number | null; parts: [string, string] | null; }
  interface MeasuredArm { mode: string; note: string; acts: string[]; t: number; expected: number[];
    speeds: number[] | null; round_trip: number; stop_time: number | null; stop_angle: number | null;
    stop_distance: number | null; sensors: number[]; }
  interface Mesh { is: "mesh"; id?: number | string | null; key: string; name: string; text: string; size: number[];
    triangles: number; scale?: number; }
  interface MotionEnd { how: string; why: string; seconds: number; q: number[]; gripper: number; T: number[][] | null; }
  interface Node { node: string; kind: string; of: string; fields: Field[]; }
  interface Nudge { do: "nudge"; axis: number; by: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface Objects { is: "objects"; id?: number | string | null; objects: SceneObject[]; }
  interface OperateArm { do: "operate_arm"; act: ArmAct; confirmed?: boolean; id?: number | string | null;
    revocations?: number | null; made?: number | null; }
  interface Orient { do: "orient"; R: number[][]; frame?: Frame; id?: number | string | null;
    revocations?: number | null; made?: number | null; wait?: number | null; }
  type Page = Choices | TextBlock;
  interface PartRefusal { part: number; command: string; why: string; }
  interface Pause { do: "pause"; id?: number | string | null; revocations?: number | null; made?: number | null; }
  interface Place { do: "place"; id?: number | string | null; revocations?: number | null; made?: number | null;
    name: string; T?: number[][] | null; near?: [number, number] | null; frame?: Frame; shape?: Shape | null;
    size?: number[] | null; mesh?: string | null; can_be_held?: boolean | null; zone?: Zone | null;
    scale?: number | null; colour?: string | null; opacity?: number | null; hidden?: boolean | null; }
  interface Pose { do: "pose"; T: number[][]; frame?: Frame; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface Position { do: "position"; p: number[]; frame?: Frame; id?: number | string | null;
    revocations?: number | null; made?: number | null; wait?: number | null; }
  interface Preview { do: "preview"; id?: number | string | null; revocations?: number | null; made?: number | null;
    at: number | null; }
  type Priority = "orientation" | "pose" | "position" | "position and pitch";
  interface Program { do: "program"; id?: number | string | null; revocations?: number | null; made?: number | null;
    text: string; more?: boolean; speed?: number; }
  type ProgramOrder = "continue" | "end" | "pause" | "resume" | "rewind" | "run" | "step";
  interface ProgramPlan { is: "program_plan"; id?: number | string | null; text?: string; program?: Progress | null;
    steps?: ProgramStep[]; seconds?: number; look?: number | null; }
  interface ProgramStep { name: string; seconds: number; mark: string; predicted: boolean; line: number; column: number;
    }
  interface Progress { name: string; by: string; status: string; step: number; steps: number; line: number;
    task: string; fraction: number; seconds: number; seconds_left: number; why: string; skipped: number[];
    breakpoints: number[]; can_continue: boolean; }
  interface Query { do: "query"; id?: number | string | null; revocations?: number | null; made?: number | null;
    at?: "arm" | "branches" | "loop" | "objects" | "program_plan" | "state" | "world"; }
  interface Redo { do: "redo"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Refused { is: "refused"; id?: number | string | null; why: string; code?: string; retry?: number | null;
    choices?: string[] | null; }
  interface ReleaseLease { do: "release_lease"; id?: number | string | null; revocations?: number | null;
    made?: number | null; }
  interface Remove { do: "remove"; name: string; id?: number | string | null; revocations?: number | null;
    made?: number | null; }
  interface Rename { do: "rename"; id?: number | string | null; revocations?: number | null; made?: number | null;
    name: string; }
  interface Resume { do: "resume"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Scene { is: "scene"; id?: number | string | null; key: string; objects: string[]; text: string; }
  interface SceneObject { name: string; shape: string; size: number[]; T: number[][]; can_be_held: boolean;
    held: boolean; mesh: string | null; scale: number; colour: string | null; opacity: number; hidden: boolean;
    fixed: boolean; zone: string; overlap: string; }
  interface Servo { do: "servo"; q: number[]; qd?: number[] | null; gripper?: number | null;
    id?: number | string | null; revocations?: number | null; made?: number | null; }
  interface Set { do: "set"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; node: string; field: string; value: number[]; more?: FieldSetting[]; }
  interface SetPriority { do: "set_priority"; priority: Priority; id?: number | string | null;
    revocations?: number | null; made?: number | null; }
  type Shape = "box" | "cylinder" | "mesh" | "plane" | "sphere" | "vessel";
  interface Speed { do: "speed"; value: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; }
  interface State { is: "state"; id?: number | string | null; t: number; sent: number; ticket: number; q: number[];
    setpoint: number[]; qd: number[]; goal: number[]; gripper: number; gripper_goal: number; tool: string | null;
    T: number[][] | null; pitch: number | null; roll: number | null; tool_speed: number | null;
    holding: number[] | null; margins: Margins | null; touching: string[]; touch: Touch | null; held: string | null;
    branch: string[] | null; priority: string | null; status: string; moving: boolean; why: string; findings: Finding[];
    speed: number; holder: string | null; stopped: string | null; stop: string | null; stopped_at: number | null;
    clearable: boolean; revocations: number; silence_profile: string; age: number; participants: number;
    water: Water | null; arm?: MeasuredArm | null; program?: Progress | null; fields?: Value[]; }
  interface Steer { do: "steer"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; order: ProgramOrder; at?: number | null; }
  interface StepTool { do: "step_tool"; by: number[]; frame?: JogFrame; id?: number | string | null;
    revocations?: number | null; made?: number | null; wait?: number | null; }
  interface StepValue { name: string; line: number; column: number; end: number; text: string; about?: string;
    unit?: string; step?: number; options?: string[]; free?: boolean; before?: string; after?: string; }
  interface Stop { do: "stop"; id?: number | string | null; revocations?: number | null; made?: number | null;
    press?: string | null; }
  interface Take { do: "take"; id?: number | string | null; revocations?: number | null; made?: number | null; }
  interface TextBlock { first: number; last: number; line: number; column: number; indent: number | null; group: number;
    depth: number; title: string; enabled?: boolean; values?: StepValue[]; }
  interface Tool { do: "tool"; name: string; id?: number | string | null; revocations?: number | null;
    made?: number | null; }
  interface Touch { preload: number; force_limit: number; fingers: FingerForce[]; }
  interface Turn { do: "turn"; pitch: number; roll: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface TurnElbow { do: "turn_elbow"; by: number; id?: number | string | null; revocations?: number | null;
    made?: number | null; wait?: number | null; }
  interface Undo { do: "undo"; id?: number | string | null; revocations?: number | null; made?: number | null;
    wait?: number | null; }
  interface Value { node: string; field: string; value: number | number[]; }
  interface Values { is: "values"; id?: number | string | null; values: Value[]; }
  interface Watch { do: "watch"; id?: number | string | null; revocations?: number | null; made?: number | null;
    hz: number; fields?: FieldName[]; }
  interface Water { cup_ml: number; basin_ml: number; air_ml: number; spilled_ml: number;
    vessels_ml: Record<string, number>; margin_to_rim: number; }
  interface Welcome { is: "welcome"; id?: number | string | null; name: string; number: number; role: string;
    heartbeat: number; api?: number; stop_port?: number | null; }
  interface Withdraw { do: "withdraw"; id?: number | string | null; revocations?: number | null; made?: number | null; }
  interface World { is: "world"; id?: number | string | null; nodes: Node[]; }
  type Zone = "keep_out" | "none" | "slow";
}
