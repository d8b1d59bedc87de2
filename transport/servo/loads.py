"""Loads, and the tools of an application's own, on the wire."""

from hil.values.errors import ConfigurationError
from hil.values.load import AttachedTool, Load
from transport.servo import servo_pb2
from transport.servo.fields import read_finite, read_pose, undecodable, wire_pose


def read_load(wire: servo_pb2.Load) -> Load:
    [mass_kg] = read_finite((wire.mass_kg,), 1, "a mass")
    x, y, z = read_finite(wire.centre_m, 3, "a centre of mass")
    xx, yy, zz, xy, xz, yz = read_finite(wire.inertia_kg_m2, 6, "an inertia")
    try:
        return Load(mass_kg, (x, y, z), (xx, yy, zz), (xy, xz, yz))
    except ConfigurationError as error:
        raise undecodable(f"a load no tool has: {error}") from None


def wire_load(load: Load) -> servo_pb2.Load:
    """Return a load."""
    inertia = load.moments_kg_m2 + load.products_kg_m2
    return servo_pb2.Load(mass_kg=load.mass_kg, centre_m=load.centre_m, inertia_kg_m2=inertia)


def read_tool(wire: servo_pb2.StartMotion | servo_pb2.ValidateLoad) -> AttachedTool | None:
    """Return the tool in a request, if any; raise :class:`MalformedDatagram` where it is none."""
    if not wire.HasField("tool"):
        return None
    return AttachedTool(read_load(wire.tool.load), read_pose(wire.tool.tcp_in_flange))


def wire_tool(tool: AttachedTool | None) -> servo_pb2.AttachedTool | None:
    """Return a tool that may be left out; raise :class:`ConfigurationError` if no packet can carry it."""
    if tool is None:
        return None
    return servo_pb2.AttachedTool(load=wire_load(tool.load), tcp_in_flange=wire_pose(tool.tcp_in_flange))
