"""``[robot.base]``, ``[[robot.tool]]`` and ``[[robot.frame]]``: the frames of a robot, in millimetres and degrees.

A pose is x, y, z and KUKA's angles A, B, C: Rz(A) Ry(B) Rx(C), each in the frame it hangs below.
"""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from hil.values.frames import BASE, FLANGE, Frame, FrameKind, FrameTree
from hil.values.load import Load
from hil.values.pose import Pose
from hil.values.robot import Three

_MM = 1e-3


class PoseConfig(BaseModel):
    """Where one frame stands in another."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    x_mm: Annotated[float, Field(description="along x, millimetres")] = 0.0
    y_mm: Annotated[float, Field(description="along y, millimetres")] = 0.0
    z_mm: Annotated[float, Field(description="along z, millimetres")] = 0.0
    a_deg: Annotated[float, Field(description="A: about z, degrees")] = 0.0
    b_deg: Annotated[float, Field(description="B: about the turned y, degrees")] = 0.0
    c_deg: Annotated[float, Field(description="C: about the turned x, degrees")] = 0.0

    def pose(self) -> Pose:
        """Return it in metres and as a rotation."""
        position_m = (self.x_mm * _MM, self.y_mm * _MM, self.z_mm * _MM)
        return Pose.from_abc_deg(position_m, self.a_deg, self.b_deg, self.c_deg)


class FrameConfig(PoseConfig):
    """``[[robot.frame]]``: a reference frame, which stands still in the robot base."""

    name: Annotated[str, Field(description="name of the frame")]
    parent: Annotated[str, Field(description="world, base, or a frame before this one")] = BASE


class ToolFrameConfig(PoseConfig):
    """``[[robot.tool.frame]]``: a frame of the tool, such as its TCP."""

    name: Annotated[str, Field(description="name of the frame")]
    parent: Annotated[str | None, Field(description="another frame of the tool; default: the tool")] = None


class LoadConfig(BaseModel):
    """``[robot.load]``: what truly hangs on the flange of a simulated arm, if the mounted tool does not tell."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mass_kg: Annotated[float, Field(ge=0.0, description="mass, kg")] = 0.0
    centre_mm: Annotated[
        Three, Field(description="centre of mass in the flange, or in the tool's frame, millimetres")
    ] = (0.0, 0.0, 0.0)
    inertia_kg_m2: Annotated[
        tuple[float, float, float, float, float, float],
        Field(description="about the centre of mass: xx, yy, zz, xy, xz, yz, kg m2"),
    ] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def load(self) -> Load:
        """Return it in SI units; raise :class:`ConfigurationError` for an inertia no body has."""
        x, y, z = self.centre_mm
        return Load(self.mass_kg, (x * _MM, y * _MM, z * _MM), self.inertia_kg_m2[:3], self.inertia_kg_m2[3:])


class ToolConfig(PoseConfig, LoadConfig):
    """``[[robot.tool]]``: a tool, by its pose in the flange, with its frames and its load."""

    name: Annotated[str, Field(description="name of the tool, and of the frame it is mounted at")]
    mounted: Annotated[
        bool, Field(strict=True, description="whether it is at the flange from the start; one tool at most")
    ] = False
    frame: Annotated[tuple[ToolFrameConfig, ...], Field(description="frames of the tool")] = ()


def frame_tree(*, base: PoseConfig, tools: tuple[ToolConfig, ...], frames: tuple[FrameConfig, ...]) -> FrameTree:
    """Return the tree of a robot; raise :class:`ConfigurationError` where it is none."""
    nodes = [Frame(one.name, FrameKind.REFERENCE, one.parent, one.pose()) for one in frames]
    for tool in tools:
        nodes.append(Frame(tool.name, FrameKind.TOOL, FLANGE, tool.pose(), tool.load()))
        nodes += [Frame(one.name, FrameKind.TOOL_FRAME, one.parent or tool.name, one.pose()) for one in tool.frame]
    return FrameTree(nodes, base_in_world=base.pose())
