"""Runs inside Blender: answers the driver's questions, a line of JSON each, on a Unix socket (SANGUINE_BRIDGE).

`{"eval": expression}` or `{"exec": statements}` in, `{"value": …}` or `{"error": traceback}` out. A timer asks the
socket, so that every answer is given between two redraws, as an operator's would be.
"""

import json
import os
import socket
import traceback

import bpy

EVERY_S = 0.05


class Bridge:
    def __init__(self, path: str) -> None:
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(path)
        self.server.listen(1)
        self.server.setblocking(False)
        self.client: socket.socket | None = None
        self.names = {"bpy": bpy}

    def poll(self) -> float:
        try:
            if self.client is None:
                self.client, _ = self.server.accept()
                self.client.setblocking(False)
            question = self.client.recv(1 << 20)
        except BlockingIOError:
            return EVERY_S
        if not question:
            self.client.close()
            self.client = None
            return EVERY_S
        self.client.setblocking(True)
        self.client.sendall(json.dumps(self.answer(json.loads(question))).encode() + b"\n")
        self.client.setblocking(False)
        return EVERY_S

    def answer(self, question: dict[str, str]) -> dict[str, object]:
        window = bpy.context.window_manager.windows[0]
        view = next((area for area in window.screen.areas if area.type == "VIEW_3D"), window.screen.areas[0])
        region = next(region for region in view.regions if region.type == "WINDOW")
        try:
            with bpy.context.temp_override(window=window, area=view, region=region):
                if "exec" in question:
                    exec(question["exec"], self.names)
                    return {"value": None}
                return {"value": eval(question["eval"], self.names)}
        except Exception:
            return {"error": traceback.format_exc()}


bpy.context.preferences.system.viewport_aa = "OFF"  # smoothed edges take many redraws to come to rest
bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(Bridge(os.environ["SANGUINE_BRIDGE"]).poll, persistent=True)
