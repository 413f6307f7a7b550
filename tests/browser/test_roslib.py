"""roslib in a page of another site sees the arm, jogs it, runs and cancels a trajectory, stops."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.server import APP, AppServer
from tests.exchange.tools import ROSLIB, THREE, needs_package

pytestmark = [pytest.mark.long, needs_package(ROSLIB)]

PAGE = """<!doctype html><title>roslib</title>
<script type="importmap">{"imports": {
  "roslib": "/roslib/dist/RosLib.js",
  "bson": "/bson/lib/bson.mjs",
  "cbor2": "/cbor2/lib/index.js",
  "@cto.af/wtf8": "/@cto.af/wtf8/lib/index.js",
  "eventemitter3": "/eventemitter3/dist/eventemitter3.esm.js",
  "fast-png": "/fast-png/lib/index.js",
  "fflate": "/fflate/esm/browser.js",
  "iobuffer": "/iobuffer/lib/iobuffer.js",
  "uuid": "/uuid/dist/index.js",
  "ws": "/ws/browser.js",
  "three": "/three/build/three.module.js",
  "three/addons/": "/three/examples/jsm/"
}}</script>"""

CONNECT = """async url => {
  const ROSLIB = await import("roslib");
  const ros = new ROSLIB.Ros({url});
  await new Promise((ok, no) => { ros.on("connection", ok); ros.on("error", no); });
  window.statuses = [];
  // The event of a status is named for the id that roslib has given the message.
  const emit = ros.emit.bind(ros);
  ros.emit = (name, ...rest) => {
    if (`${name}`.startsWith("status")) statuses.push(rest[0].msg);
    return emit(name, ...rest);
  };
  window.ROSLIB = ROSLIB;
  window.ros = ros;
  window.pause = seconds => new Promise(ok => setTimeout(ok, 1e3 * seconds));
  window.topic = (name, messageType) => new ROSLIB.Topic({ros, name, messageType});
  window.first = topic => new Promise(ok => topic.subscribe(ok));
  window.joints = () => newest.position.slice(0, 5);
  topic("/joint_states", "sensor_msgs/JointState").subscribe(each => { window.newest = each; });
  window.arm = new ROSLIB.Action({ros, name: "/arm_controller/follow_joint_trajectory",
    actionType: "control_msgs/action/FollowJointTrajectory"});
  window.send = (seconds, positions) => {
    const joint_names = [1, 2, 3, 4, 5].map(k => `axis_${k}`);
    const points = [{positions, time_from_start: {sec: seconds, nanosec: 0}}];
    const found = {feedback: 0};
    found.result = new Promise(ok => {
      found.id = arm.sendGoal({trajectory: {joint_names, points}},
        result => ok({result}), () => { found.feedback += 1; }, failed => ok({failed}));
    });
    return found;
  };
  while (!window.newest) await pause(0.01);
}"""

SEE = """async () => {
  const topics = await new Promise((ok, no) => ros.getTopics(ok, no));
  const text = (await first(topic("/robot_description", "std_msgs/String"))).data;
  const model = new ROSLIB.UrdfModel({string: text});
  const meshes = Object.values(model.links).flatMap(link => link.visuals)
    .map(visual => visual.geometry.filename).filter(each => each);
  const tf = await first(topic("/tf", "tf2_msgs/TFMessage"));
  return {topics: topics.topics, name: model.name, links: Object.keys(model.links), meshes,
    frames: tf.transforms.map(each => each.child_frame_id)};
}"""

RUN = """async () => {
  const found = send(2, [0.4, -1.1, 1.4, 0.2, 0.3]);
  return {...await found.result, feedback: found.feedback, q: joints()};
}"""

CANCEL = """async () => {
  const found = send(6, [-0.6, -1.1, 1.4, 0.2, 0.3]);
  while (joints()[0] > 0.38) await pause(0.01);
  arm.cancelGoal(found.id);
  const ended = await found.result, q = joints();
  await pause(0.5);
  return {...ended, q, later: joints()};
}"""

JOG = """async () => {
  const before = joints();
  const twists = topic("/servo_node/delta_twist_cmds", "geometry_msgs/TwistStamped");
  const header = {stamp: {sec: 0, nanosec: 0}, frame_id: "base_link"};
  const angular = {x: 0, y: 0, z: 0};
  for (let k = 0; k < 30; k++) {
    twists.publish({header, twist: {linear: {x: 0, y: 0, z: 0.2}, angular}});
    await pause(0.03);
  }
  await pause(1.5);
  const after = joints();
  await pause(0.3);
  twists.publish({header, twist: {linear: angular, angular: {x: 0, y: 0, z: 0.5}}});
  while (!statuses.length) await pause(0.01);
  return {before, after, later: joints(), statuses};
}"""

STOP = """async () => {
  const found = send(6, [-0.6, -1.1, 1.4, 0.2, 0.3]), at = joints();
  while (Math.abs(joints()[0] - at[0]) < 0.02) await pause(0.01);
  const stop = new ROSLIB.Service({ros, name: "/stop", serviceType: "std_srvs/Trigger"});
  const response = await new Promise((ok, no) => stop.callService({}, ok, no));
  const ended = await found.result;
  const state = JSON.parse((await first(topic("/katana450/state", "std_msgs/String"))).data);
  return {response, ...ended, stopped: state.stopped};
}"""


class _Files(SimpleHTTPRequestHandler):
    """Serves the page, roslib with its packages, and three.js."""

    def do_GET(self) -> None:
        script, path = ROSLIB.file, self.path.lstrip("/")
        assert script is not None
        place = THREE.folder / "package" if path.startswith("three/") else script.parents[2]
        own = place / path.removeprefix("three/")
        if path and not own.is_file():
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", "text/javascript" if path else "text/html")
        self.end_headers()
        self.wfile.write(own.read_bytes() if path else PAGE.encode())

    def log_message(self, *_words: object) -> None:
        """Print nothing."""


@pytest.fixture(scope="module")
def site() -> Iterator[str]:
    """Serve the page as another site does; yield its origin."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Files) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def opened(browser: Browser, site: str) -> Iterator[Page]:
    """Open the page of ``site``."""
    page = browser.new_page()
    try:
        page.goto(site)
        yield page
    finally:
        page.close()


def test_roslib_drives_the_arm(browser: Browser, site: str) -> None:
    with AppServer((*APP, "--ros-page", site)) as server, opened(browser, site) as page:
        page.evaluate(CONNECT, server.url.replace("http", "ws") + "/rosbridge")
        sight: dict[str, Any] = page.evaluate(SEE)
        assert {"/joint_states", "/tf", "/tf_static"} <= set(sight["topics"])
        assert sight["name"] == "katana450"
        assert "tcp" in sight["links"]
        assert "pan_link" in sight["frames"]
        assert len(sight["meshes"]) > 30

        shown: dict[str, Any] = page.evaluate(RUN)
        assert shown["result"]["error_code"] == 0
        assert shown["feedback"] >= 10
        assert shown["q"] == pytest.approx([0.4, -1.1, 1.4, 0.2, 0.3], abs=1e-3)

        shown = page.evaluate(CANCEL)
        assert "5" in shown["failed"] or "cancel" in shown["failed"].lower()
        assert shown["q"][0] > 0.0
        assert shown["later"] == pytest.approx(shown["q"], abs=0.02)

        shown = page.evaluate(JOG)
        assert max(abs(a - b) for a, b in zip(shown["before"], shown["after"], strict=True)) > 0.01
        assert shown["later"] == pytest.approx(shown["after"], abs=1e-6)
        assert "five axes" in shown["statuses"][0]

        shown = page.evaluate(STOP)
        assert shown["response"] == {"success": True, "message": "requested"}
        assert "STOP" in shown["failed"]
        assert "pressed STOP" in shown["stopped"]
