"""A stand-in for CoppeliaSim: the server side of its ZeroMQ remote API, with a little scene behind it.

Written from the documented protocol and API; the simulator itself was not available. It is strict where that is: a
request without its fields, an object that is not there, a number of the wrong kind are errors. It has no graphics, no
physics and no scripts.
"""

import importlib
import itertools
import math
import random
import re
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

import cbor

from backends.robots.facts import JOINT_AXES, ROBOTS
from hil.values.pose import NOWHERE, Pose

zmq: Any = importlib.import_module("zmq")  # it has types that mypy cannot follow

SHAPE, JOINT, DUMMY = 0, 1, 4
REVOLUTE, PRISMATIC = 10, 11
KINEMATIC, DYNAMIC = 0, 5
WORLD = -1
CONSTANTS = {
    "handle_scene": -12,
    "handle_world": WORLD,
    "sceneobject_shape": SHAPE,
    "sceneobject_joint": JOINT,
    "sceneobject_dummy": DUMMY,
    "joint_revolute": REVOLUTE,
    "joint_prismatic": PRISMATIC,
    "jointmode_kinematic": KINEMATIC,
    "jointmode_dynamic": DYNAMIC,
    "modelproperty_not_model": 0xF000,
    "scripttype_sandbox": 8,
    "simulation_stopped": 0,
    "simulation_advancing": 16,
    "colorcomponent_ambient_diffuse": 0,
}
GREY_AND_ORANGE = [0.9, 0.9, 0.9, 1.0, 0.5, 0.1]
"""Of a shape that is made of two."""


class Refusal(Exception):  # what the simulator answers, not an error of ours
    """What the simulator says instead of a value."""


@dataclass
class Thing:
    """An object of the scene."""

    kind: int
    alias: str
    parent: int
    in_parent: Pose
    model: bool = False
    subtype: int = REVOLUTE
    position: float = 0.0
    mode: int = DYNAMIC
    colours: list[float] = field(default_factory=lambda: [*GREY_AND_ORANGE])


class Scene:
    """A tree of objects by handle; handles are in no order, as after some work with the real one."""

    def __init__(self, seed: int = 1) -> None:
        handles = list(range(15, 400))
        random.Random(seed).shuffle(handles)
        self._handles = iter(handles)
        self.things: dict[int, Thing] = {}

    def add(self, thing: Thing) -> int:
        """Add it and return its handle."""
        handle = next(self._handles)
        self.things[handle] = thing
        return handle

    def standing(self, handle: int, *, moving: bool = False) -> Pose:
        """Return where it stands in the world; a joint's moving side has turned with its position."""
        if handle == WORLD:
            return NOWHERE
        thing = self.things[handle]
        pose = self.standing(thing.parent, moving=True) @ thing.in_parent
        return pose @ turned(thing.position) if moving and thing.kind == JOINT else pose

    def named(self, alias: str) -> list[int]:
        """Return the handles of all that have that name."""
        return [handle for handle, thing in self.things.items() if thing.alias == alias]

    def children(self, handle: int) -> dict[str, int]:
        """Return what hangs below it, by name."""
        return {thing.alias: one for one, thing in self.things.items() if thing.parent == handle}

    def path(self, handle: int) -> str:
        """Return the short path that is this one's only."""
        thing = self.things[handle]
        same = sorted(one for one in self.named(thing.alias) if self.things[one].model == thing.model)
        return f"/{thing.alias}" + (f"[{same.index(handle)}]" if len(same) > 1 else "")


def turned(angle_rad: float) -> Pose:
    """Return a turn about z."""
    return Pose.from_abc_rad((0.0, 0.0, 0.0), angle_rad, 0.0, 0.0)


def add_arm(
    scene: Scene,
    model: str = "lbr-iiwa-14-r820",
    *,
    alias: str = "LBRiiwa14R820",
    base: Pose = NOWHERE,
    joints: int = 7,
    turns_other_way: Sequence[int] = (),
    upper_arm_m: float | None = None,
    at_rad: float = 0.3,
) -> list[int]:
    """Add an arm as the simulator's model is built, and return its joints: each hangs below the link before it.

    All joints are named alike, and their frames are drawn where that model likes, turned about their axes.
    """
    facts = next(one for one in ROBOTS if one.description.name == model)
    heights = list(facts.joint_heights_m)
    if upper_arm_m is not None:
        heights = [h + (upper_arm_m - facts.lengths_m[1] if i >= 3 else 0.0) for i, h in enumerate(heights)]
    above = scene.add(Thing(SHAPE, alias, WORLD, base @ turned(0.7), model=True))
    before = base @ turned(0.7)
    handles = []
    for i in range(joints):
        x, y, z = JOINT_AXES[i % 7]
        sign = -1.0 if i + 1 in turns_other_way else 1.0
        stands = base @ Pose(0.0, 0.0, heights[i % 7]) @ pointing((sign * x, sign * y, sign * z)) @ turned(0.4 * i)
        joint = scene.add(Thing(JOINT, "joint", above, before.inverse() @ stands, position=at_rad))
        link = scene.add(Thing(SHAPE, f"link{i + 1}_resp", joint, Pose(0.0, 0.0, 0.05)))
        above, before = link, stands @ Pose(0.0, 0.0, 0.05)
        handles.append(joint)
    return handles


def pointing(axis: tuple[float, float, float]) -> Pose:
    """Return a pose whose z axis is ``axis``, one of +-y and +-z."""
    _, y, z = axis
    return Pose.from_abc_rad((0.0, 0.0, 0.0), 0.0, 0.0, math.atan2(-y, z))


class StandIn:
    """The server, in a thread, on a free port of ``host``; open inside its ``with`` block.

    Every ``waits`` requests it says first that it is busy, as the real one does between two pictures. ``lua`` is how
    its sandbox takes a line of Lua: not at all, ``taken``, or ``ignored`` without a word.
    """

    def __init__(self, host: str, *, scenes: dict[str, Callable[[], Scene]], waits: int = 5, lua: str = "") -> None:
        self.host = host
        self.scenes = scenes
        self.scene = Scene()
        self.simulation = 0
        self.calls: list[str] = []
        self.loaded: list[str] = []
        self.busy_for_ever = False
        self.lua = lua
        self._waits = waits
        self._port = 0
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._clients: set[str] = set()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.die()

    @property
    def address(self) -> str:
        """HOST:PORT."""
        return f"{self.host}:{self._port}"

    def start(self) -> None:
        """Serve, with an empty scene, on the port of before."""
        self._ended.clear()
        self.scene = Scene()
        self._clients.clear()
        context = zmq.Context()
        socket = context.socket(zmq.REP)
        socket.linger = 0
        if self._port:
            socket.bind(f"tcp://{self.host}:{self._port}")
        else:
            self._port = socket.bind_to_random_port(f"tcp://{self.host}")
        self._thread = threading.Thread(target=self._serve, args=(context, socket))
        self._thread.start()

    def die(self) -> None:
        """Be gone in the middle of whatever happens."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _serve(self, context: Any, socket: Any) -> None:
        kept: dict[str, Any] = {}
        numbers = itertools.count(1)
        while not self._ended.is_set():
            if not socket.poll(5):
                continue
            request = cbor.loads(socket.recv())
            if request["func"] == "_*executed*_":
                reply = kept.pop(request["uuid"])
            else:
                reply = self._reply(request)
                if next(numbers) % self._waits == 0 or self.busy_for_ever:
                    kept[request["uuid"]] = reply
            if request["uuid"] in kept or self.busy_for_ever:
                kept.setdefault(request["uuid"], reply)
                reply = {"func": "_*wait*_", "args": []}
            socket.send(cbor.dumps(reply))
        socket.close()
        context.term()

    def _reply(self, request: dict[str, Any]) -> dict[str, Any]:
        known = request["uuid"] in self._clients
        self._clients.add(request["uuid"])
        if not known and {"ver", "lang", "timeout"} - request.keys():
            return {"err": "the first request of a client tells its version, language and timeout"}
        if request["argsL"] != len(request["args"]):
            return {"err": f"{request['argsL']} arguments were announced, {len(request['args'])} came"}
        self.calls.append(request["func"])
        try:
            value = self._call(request["func"], request["args"])
        except Refusal as refusal:
            return {"err": f"{refusal} (in function '{request['func']}')_=NL=_stack traceback:_=TB=_..."}
        if value is None:
            return {"ret": []}
        # An empty table of Lua is neither a list nor a map.
        values = value if isinstance(value, tuple) else (value,)
        return {"ret": [{} if one == [] else one for one in values]}

    def _call(self, name: str, arguments: list[Any]) -> Any:
        if name == "zmqRemoteApi.require":
            return None
        functions = {
            re.sub("_(.)", lambda found: found[1].upper(), one.removeprefix("_do_")): getattr(self, one)
            for one in dir(self)
            if one.startswith("_do_")
        }
        if name == "zmqRemoteApi.info":
            return {
                **{one: {"func": {}} for one in functions},
                **{one: {"const": value} for one, value in CONSTANTS.items()},
            }
        try:
            function = functions[name.removeprefix("sim.")]
        except KeyError:
            raise Refusal(f"No such function: {name}") from None
        return function(*arguments)

    def _thing(self, handle: Any, *kinds: int) -> Thing:
        if type(handle) is not int or handle not in self.scene.things:
            raise Refusal("Object does not exist.")
        thing = self.scene.things[handle]
        if kinds and thing.kind not in kinds:
            raise Refusal("Object is not of the right type.")
        return thing

    def _do_load_scene(self, path: str) -> None:
        if self.simulation:
            raise Refusal("Simulation must be stopped.")
        if path not in self.scenes:
            raise Refusal("Scene could not be read.")
        self.scene = self.scenes[path]()
        self.loaded.append(path)

    def _do_get_simulation_state(self) -> int:
        return self.simulation

    def _do_get_objects_in_tree(self, base: int, kind: int, options: int) -> list[int]:
        assert options == 0
        if base != CONSTANTS["handle_scene"]:
            self._thing(base)
        found = []
        for handle, thing in sorted(self.scene.things.items()):
            above = handle
            while above not in {base, WORLD}:
                above = self.scene.things[above].parent
            if thing.kind == kind and (base == CONSTANTS["handle_scene"] or above == base):
                found.append(handle)
        return found

    def _do_get_object_parent(self, handle: int) -> int:
        return self._thing(handle).parent

    def _do_get_model_property(self, handle: int) -> int:
        return 0 if self._thing(handle).model else CONSTANTS["modelproperty_not_model"] | 3

    def _do_get_joint_type(self, handle: int) -> int:
        return self._thing(handle, JOINT).subtype

    def _do_get_joint_mode(self, handle: int) -> tuple[int, int]:
        return self._thing(handle, JOINT).mode, 0

    def _do_set_joint_mode(self, handle: int, mode: int, options: int) -> None:
        assert options == 0
        self._thing(handle, JOINT).mode = mode

    def _do_set_joint_position(self, handle: int, position: float) -> None:
        thing = self._thing(handle, JOINT)
        if thing.mode != KINEMATIC:
            raise Refusal("The joint is not in kinematic mode.")
        thing.position = float(position)

    def _do_get_joint_position(self, handle: int) -> float:
        return self._thing(handle, JOINT).position

    def _do_get_script(self, kind: int) -> int:
        assert kind == CONSTANTS["scripttype_sandbox"]
        if not self.lua:
            raise Refusal("There is no such script.")
        return 77

    def _do_execute_script_string(self, text: str, script: int) -> tuple[int, str] | int:
        assert script == 77
        lua, language = text.rsplit("@", 1)
        assert language == "lua"
        if self.lua == "taken":
            for statement in lua.split():
                found = re.fullmatch(r"sim\.setJointPosition\((\d+),(-?\d+\.\d+)\)", statement)
                if found is None or int(found[1]) not in self.scene.things:
                    return -1, "an error of Lua"
                self._do_set_joint_position(int(found[1]), float(found[2]))
        return 0

    def _do_get_object_alias(self, handle: int, options: int) -> str:
        thing = self._thing(handle)
        return {-1: thing.alias, 1: self.scene.path(handle)}[options]

    def _do_set_object_alias(self, handle: int, alias: str) -> None:
        self._thing(handle).alias = re.sub(r"[^\w -]", "_", alias)

    def _do_get_object_pose(self, handle: int, reference: int) -> list[float]:
        self._thing(handle)
        if reference != WORLD:
            self._thing(reference)
        pose = self.scene.standing(reference, moving=True).inverse() @ self.scene.standing(handle)
        w, x, y, z = pose.quaternion_wxyz()
        return [*pose.position_m, x, y, z, w]

    def _do_set_object_pose(self, handle: int, pose: list[float], reference: int) -> None:
        thing = self._thing(handle)
        if len(pose) != 7 or abs(math.hypot(*pose[3:]) - 1.0) > 1e-6:
            raise Refusal("Pose is invalid.")
        x_m, y_m, z_m, x, y, z, w = pose
        stands = self.scene.standing(reference, moving=True) @ Pose.from_quaternion((x_m, y_m, z_m), (w, x, y, z))
        thing.in_parent = self.scene.standing(thing.parent, moving=True).inverse() @ stands

    def _do_create_dummy(self, size_m: float) -> int:
        assert size_m > 0.0
        return self.scene.add(Thing(DUMMY, "Dummy", WORLD, NOWHERE))

    def _do_set_object_parent(self, handle: int, parent: int, in_place: bool) -> None:
        thing = self._thing(handle)
        self._thing(parent)
        stands = self.scene.standing(handle)
        thing.parent = parent
        if in_place:
            thing.in_parent = self.scene.standing(parent, moving=True).inverse() @ stands

    def _do_remove_objects(self, handles: list[int]) -> None:
        for handle in handles:
            parent = self._thing(handle).parent
            for other in list(self.scene.children(handle).values()):
                self.scene.things[other].parent = parent
            del self.scene.things[handle]

    def _do_get_shape_color(self, handle: int, name: str, part: int) -> tuple[int, list[float]]:
        assert (name, part) == ("@compound", 0)
        return 1, [*self._thing(handle, SHAPE).colours]

    def _do_set_shape_color(self, handle: int, name: str, part: int, colours: list[float]) -> None:
        assert (name, part) == ("@compound", 0)
        if len(colours) != len(GREY_AND_ORANGE):
            raise Refusal("Table size is wrong.")
        self._thing(handle, SHAPE).colours = [*colours]
