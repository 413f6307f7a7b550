"""The extensions of this distribution, in the order of their commands in the help text."""

from __future__ import annotations

from katana450.extension import CliCommand, Extension

HERE = "katana450.extensions"

EXTENSIONS = (
    Extension(
        "server_commands",
        (
            CliCommand(
                "access",
                "give people links with which they sign in",
                f"{HERE}.server_commands.access_command:add_access_options",
                f"{HERE}.server_commands.access_command:access",
            ),
        ),
    ),
    Extension("api_description", routes=f"{HERE}.api_description:description_routes"),
    Extension(
        "programs",
        serve_options=f"{HERE}.programs.serve_options:add_serve_options",
        view_layer=f"{HERE}.programs.server.traces:TracesLayer",
        routes=f"{HERE}.programs.server.script_routes:routes",
        folder=f"{HERE}.programs.server.preview:program_preview",
    ),
    Extension(
        "robot_choice",
        routes=f"{HERE}.robot_choice.choose_robot:late_routes",
        handler=f"{HERE}.robot_choice.choose_robot:RobotChoice",
    ),
    Extension(
        "importers",
        serve_options=f"{HERE}.importers.serve_parts:add_serve_options",
        initial_scene=f"{HERE}.importers.serve_parts:chosen_scene",
        routes=f"{HERE}.importers.serve_parts:upload_routes",
    ),
    Extension(
        "export",
        (
            CliCommand(
                "export",
                "write the arm as files for other programs",
                f"{HERE}.export.options:add_export_options",
                f"{HERE}.export.options:export_format",
            ),
        ),
    ),
    Extension(
        "experiments",
        (
            CliCommand(
                "run",
                "run a script of your own",
                f"{HERE}.experiments.options:add_run_options",
                f"{HERE}.experiments.run:run",
            ),
            CliCommand(
                "demo",
                "run an experiment of the paper",
                f"{HERE}.experiments.options:add_demo_options",
                f"{HERE}.experiments.run:demo",
            ),
        ),
    ),
    Extension(
        "media",
        (
            CliCommand(
                "render",
                "render a picture of the arm, without a browser",
                f"{HERE}.media.options:add_render_options",
                f"{HERE}.media.render:render",
            ),
        ),
    ),
    Extension(
        "cameras",
        serve_options=f"{HERE}.cameras.serve_parts:add_serve_options",
        routes=f"{HERE}.cameras.serve_parts:routes",
        process=f"{HERE}.cameras.serve_parts:process",
    ),
    Extension("phone", routes=f"{HERE}.phone:phone_routes"),
    Extension(
        "recording",
        (
            CliCommand(
                "record",
                "keep, verify, repair and cut recordings",
                f"{HERE}.recording.options:add_record_options",
                f"{HERE}.recording.serve_parts:record",
            ),
        ),
        serve_options=f"{HERE}.recording.serve_parts:add_serve_options",
        routes=f"{HERE}.recording.serve_parts:routes",
        handler=f"{HERE}.recording.playback.continuation:Continuation",
        folder=f"{HERE}.recording.playback.drawing:PlaybackFolder",
        process=f"{HERE}.recording.serve_parts:process",
        tick_sender=f"{HERE}.recording.serve_parts:tick_sender",
    ),
    Extension(
        "kinematics",
        (
            CliCommand(
                "fk",
                "JSON lines from stdin to stdout, joints to poses: "
                '{"q": [angles, rad], "tool": "tcp"} per line',
                f"{HERE}.kinematics.options:add_fk_options",
                f"{HERE}.kinematics.json_lines:fk",
            ),
            CliCommand(
                "ik",
                "JSON lines from stdin to stdout, poses to joints: "
                '{"T": [[4x4, m]], "tool": "tcp"} per line, or "p" with "wxyz", "xyzw", "rpy", or '
                '"pitch" and "roll"',
                f"{HERE}.kinematics.options:add_ik_options",
                f"{HERE}.kinematics.json_lines:ik",
            ),
        ),
    ),
    Extension(
        "real_arm",
        (
            CliCommand(
                "emulate",
                "emulate the firmware of a Katana450 behind a TCP port",
                f"{HERE}.real_arm.options:add_emulate_options",
                f"{HERE}.real_arm.emulator.server:emulate",
            ),
        ),
        serve_options=f"{HERE}.real_arm.options:add_serve_options",
        view_layer=f"{HERE}.real_arm.options:view_layer",
        driver=f"{HERE}.real_arm.options:driver",
    ),
    Extension(
        "leader",
        (
            CliCommand(
                "leader",
                "drive the arm by a leader arm, joint to joint",
                f"{HERE}.leader.leader_options:add_leader_options",
                f"{HERE}.leader.leader_command:lead",
            ),
        ),
    ),
    Extension(
        "rosbridge",
        serve_options=f"{HERE}.rosbridge.serve_parts:add_serve_options",
        routes=f"{HERE}.rosbridge.serve_parts:routes",
    ),
    Extension(
        "gallery",
        (
            CliCommand(
                "arms",
                "list the robots that --arm can name",
                f"{HERE}.gallery.options:add_arms_options",
                f"{HERE}.gallery.arms_command:arms",
            ),
        ),
        prepare=f"{HERE}.gallery.options:choose_named",
    ),
    Extension(
        "xacro",
        prepare=f"{HERE}.xacro.xacro_file:expand_with_arguments",
    ),
    Extension(
        "objects",
        view_layer=f"{HERE}.objects.handles:HandlesLayer",
        handler=f"{HERE}.objects.object_requests:ObjectRequests",
    ),
    Extension("undo", handler=f"{HERE}.undo:UndoRequests"),
    Extension("conduit", view_layer=f"{HERE}.conduit:ConduitLayer"),
    Extension("water", view_layer=f"{HERE}.water:WaterLayer"),
)
"""Each with where its parts are, so that nothing is imported before it is used."""
