"""A leader arm at the page: a port that speaks the protocol of the servos, in a real browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.browser.page import ViserPage
from tests.browser.session import Truth
from tests.leader.emulated_leader import OFFSETS, RANGE, START, write_calibration

SERIAL = """([offsets, middle, start]) => {
  const sum = (body) => ~body.reduce((all, byte) => all + byte, 0) & 0xff;
  const low = (value) => [value & 0xff, value >> 8];
  const leader = {angles: [...start], torque: offsets.map(() => true), answers: true};
  const memory = (motor, address) => {
    const offset = offsets[motor - 1];
    if (address === 31) return low(offset < 0 ? 2048 - offset : offset);
    return low(Math.round(middle + (leader.angles[motor - 1] * 2048) / Math.PI));
  };
  const status = (id, data) => {
    const body = [id, data.length + 2, 0, ...data];
    return [0xff, 0xff, ...body, sum(body)];
  };
  const answer = ([, , id, length, code, ...rest]) => {
    const data = rest.slice(0, length - 2);
    const of = (motor) => status(motor, memory(motor, data[0]));
    if (code === 0x82) return data.slice(2).flatMap(of);
    if (code === 3 && data[0] === 40) leader.torque[id - 1] = data[1] !== 0;
    return status(id, code === 2 ? memory(id, data[0]) : []);
  };
  const port = {
    async open({baudRate}) {
      leader.baud = baudRate;
      const start = (controller) => { leader.controller = controller; };
      port.readable = new ReadableStream({start});
      port.writable = new WritableStream({write(bytes) {
        if (!leader.answers) return;
        const data = answer([...bytes]);
        // In two parts, with a byte of noise before.
        leader.controller.enqueue(new Uint8Array([0xff, ...data.slice(0, 5)]));
        leader.controller.enqueue(new Uint8Array(data.slice(5)));
      }});
    },
    async close() {},
  };
  leader.unplug = () => leader.controller.error(new Error("The device has been lost."));
  window.leader = leader;
  const serial = {requestPort: async () => port};
  Object.defineProperty(navigator, "serial", {value: serial, configurable: true});
}"""

RULES = """async (text) => {
  const {Follower} = await import("/static/leader/follower.js");
  const {inputs, fingers} = JSON.parse(text);
  const follower = new Follower(fingers);
  return JSON.stringify(inputs.map(({t, posture, state, heard, asked, eased}) => {
    const acts = follower.step(t, posture, state, heard, asked);
    if (eased !== undefined) follower.eased(eased);
    return [follower.phase, ...acts];
  }));
}"""
"""Returns what the machine of the page does with the inputs of a script, all as JSON texts."""

POSTURES = """async ([text, arm, all]) => {
  const {calibrationIn, posture} = await import("/static/leader/calibration.js");
  return all.map((ticks) => posture(calibrationIn(text), arm, new Map(ticks)));
}"""
"""Returns the postures that the page finds at positions of the motors."""

PACKETS = """async (parts) => {
  const {HOMING_OFFSET, packets, value} = await import("/static/leader/bus.js");
  const all = [];
  let rest = [];
  for (const part of parts) {
    const read = packets([...rest, ...part]);
    all.push(...read.found);
    rest = read.rest;
  }
  return all.map(({id, code, parameters}) =>
    [id, code, parameters, value(HOMING_OFFSET, parameters.slice(0, 2))]);
}"""
"""Returns the packets that the page finds in a stream that comes in parts, and a value of each."""

REFUSED = """async ([arm, text]) => {
  localStorage.setItem("katana450.leader.calibration", text);
  const {Leader} = await import("/static/leader/leader.js");
  const said = [];
  const watch = () => {};
  const panel = new Leader(document.createElement("p"), (each) => said.push(each), watch, arm);
  const state = {is: "state", setpoint: [0, 0, 0, 0, 0], stopped: null, revocations: 0,
    program: null, status: "ok", gripper: 0, moving: false, why: "", sent: 1};
  const until = async (found) => {
    while (!found()) {
      panel.hear(state);
      await new Promise((resolve) => setTimeout(resolve, 10));
    }
  };
  await panel.press();
  await until(() => leader.torque.every((each) => !each));
  await new Promise((resolve) => setTimeout(resolve, 200));
  panel.hear(state);
  await panel.press();
  await until(() => said.length);
  const heard = panel.hear({is: "refused", why: "A program is running.", id: said[0].id});
  for (let i = 0; i < 20; i += 1) {
    panel.hear(state);
    await new Promise((resolve) => setTimeout(resolve, 10));
  }
  localStorage.removeItem("katana450.leader.calibration");
  leader.unplug();
  return [heard, ...said.map((each) => each.do)];
}"""
"""Returns the requests of a leader whose program is refused."""

TURNED = 0.2
"""[rad] Angle by which the leader's pan is turned."""


def words(page: ViserPage, text: str) -> None:
    page.page.locator("#leader [role=status]", has_text=text).wait_for(timeout=20_000)


def turn_pan(page: ViserPage, angle: float) -> None:
    """Turn the first joint of the leader by ``angle`` [rad] within two seconds."""
    page.page.evaluate(
        """async (angle) => {
          for (let i = 0; i < 50; i += 1) {
            leader.angles[0] += angle / 50;
            await new Promise((resolve) => setTimeout(resolve, 40));
          }
        }""",
        angle,
    )


def setpoint(truth: Truth) -> Any:
    return np.array(truth.status()["setpoint"])


def connect_leader(page: ViserPage, tmp_path: Path) -> None:
    """Connect the leader in the Jog sheet of a window that had none."""
    page.page.evaluate(SERIAL, [list(OFFSETS), sum(RANGE) / 2.0, list(START)])
    page.page.click("#jog-button")
    page.page.get_by_role("button", name="Connect a leader arm").click()
    words(page, "Choose the calibration file")
    file = page.page.locator("#leader input[type=file]")
    wrong = tmp_path / "wrong.json"
    wrong.write_text('{"shoulder_pan": {"id": 1}}', encoding="utf-8")
    file.set_input_files(wrong)
    words(page, "drive_mode of shoulder_pan is not an integer")
    file.set_input_files(write_calibration(tmp_path / "leader.json"))
    words(page, "kept in this browser")
    page.page.get_by_role("button", name="Connect a leader arm").click()
    words(page, "Connected")
