"""Contact and friction among thousands of rigid bodies, exactly and fast.

Units are SI. Frames: W is the world. Rotations are (x, y, z, w), unit length, from a body's frame to W.
A bad value raises ValueError that names the field and the value, one of the wrong type or length TypeError; a world that is in a step raises
RuntimeError. Regions that freeze (cold_volumes) and the ladder of methods are for C++ alone.

Arrays that are properties of a world are read-only views of its memory. They show every later step, and unfinished states while another
thread steps. While one of them lives, also inside an expression or a loop over it, add() and restore() raise BufferError: copy what is to stay,
world.positions.copy(). A row of a removed body stays until its number is used again. A world that keeps a view of itself as an attribute is
never collected.
"""
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

Vector = Union[Sequence[float], np.ndarray]  # 3 numbers, or 4 for rotations: x, y, z, w (scene files: w, x, y, z)
Numbers = Union[Sequence[int], np.ndarray]  # (n,)
Rows = Union[Sequence[Vector], np.ndarray]  # (n, 3)

__version__: str

class Model:
    KINETIC: Model
    CONVEX: Model
    COULOMB: Model

class Cone:
    CIRCULAR: Cone
    OCTAGON: Cone

class BounceLaw:
    EQ5: BounceLaw
    EQ6: BounceLaw
    EXACT: BounceLaw

class Freezing:
    OFF: Freezing
    PAPER: Freezing
    CERTIFIED: Freezing

class Kind:
    FIXED: Kind
    KINEMATIC: Kind
    DYNAMIC: Kind

class Settings:
    """Settings(field=value, ...); see engine/settings.h."""
    gravity: Tuple[float, float, float]  # [m/s^2]
    model: Model
    cone: Cone
    bounce_law: BounceLaw
    freezing: Freezing
    freeze_count: int  # frames, of Freezing.PAPER
    freeze_seconds: float
    freeze_travel: float
    tolerance: float  # of the contact problems, relative to v_ref
    effort: Any  # 'quick', 'normal', 'thorough' or a number of sweeps
    bounce_limit: int  # of the queue of a crowd's or group's blows; -1: two a body
    touch_gap: float  # contacts closer than this share of a size touch
    overlap_tolerance: float  # contacts closer than this share of a size are closed: a gap, not only an overlap
    stateless: bool
    threads: int  # 0: all cores
    group_bodies: int
    def __init__(self, **fields: Any) -> None: ...
    @staticmethod
    def paper() -> Settings: ...

class Shape:
    @staticmethod
    def sphere(radius: float) -> Shape: ...
    @staticmethod
    def box(half_extents: Vector) -> Shape: ...
    @staticmethod
    def half_space() -> Shape: ...  # below z = 0 of its frame
    @staticmethod
    def capsule(radius: float, half_length: float) -> Shape: ...  # about its z axis; half_length without the caps
    @staticmethod
    def cylinder(radius: float, half_length: float) -> Shape: ...  # about its z axis
    @staticmethod
    def convex_hull(points: Any) -> Shape: ...  # (n, 3); position is then that of its centre of mass
    @property
    def hull_offset(self) -> np.ndarray: ...  # (3,): centre of mass, the origin of the body's frame, in the points that were given
    @property
    def vertices(self) -> np.ndarray: ...  # (n, 3) in the body's frame; of boxes and hulls
    @property
    def volume(self) -> float: ...
    @property
    def radius(self) -> float: ...

class Certificate:
    momentum: float
    cone: float
    dual: float
    gap: float
    coulomb_map_max: float  # [m/s]
    coulomb_map_rms: float  # [m/s]

class LedgerEntry:
    value: float  # how much, in the unit of its entry
    body: int  # whose, -1: nobody's

class Ledger:
    energy_created: LedgerEntry  # of an island, over its kinetic energy
    momentum_unexplained: LedgerEntry  # over the largest of momenta and impulses of the body
    angular_momentum_unexplained: LedgerEntry  # the same, about its centre
    displacement_without_velocity: LedgerEntry  # [m] of the body's farthest point
    sides_changed: int
    @property
    def clean(self) -> bool: ...

class StepReport:
    contacts: int
    active_contacts: int
    awake: int
    frozen: int
    woken: int  # bodies frozen before the step and not after it
    newly_frozen: int  # the other way round
    bounces: int  # of the queue of blows
    restitution_lowered: int  # islands in which rebounds were lowered: they would create energy, or have no answer
    pieces: int  # into which the steps of small groups were cut, together
    penetration_max: float  # [m]
    kinetic_energy: float  # [J]
    energy_gain: float  # [J]
    certificate: Certificate
    ledger: Ledger
    @property
    def missed(self) -> int: ...  # problems that ended above the tolerance
    unstepped: float  # [s] for which a group stood still since no way on was found
    overlapping: int  # pairs of bodies that are inside of each other at the end, by a fiftieth of a size
    motion_failures: int  # small groups that gave up a step, and pieces of a crowd that missed their end for good
    gave_up: int  # bodies of small groups that needed more work than a step has: they go with a crowd, less exactly
    @property
    def unsolved(self) -> int: ...  # problems without an answer: walls that close
    @property
    def failed(self) -> bool: ...  # the ledger is not clean, or unstepped or overlapping is more than 0

class Snapshot:
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(data: bytes) -> Snapshot: ...

class BodyId:
    number: int
    generation: int

class Body:  # as a callback sees it
    position: np.ndarray
    rotation: np.ndarray
    linear_velocity: np.ndarray
    angular_velocity: np.ndarray
    kind: Kind
    friction: float
    restitution: float

class Contact:  # the same
    body_a: int
    body_b: int
    point: np.ndarray  # [m]
    normal: np.ndarray  # unit, from a to b
    gap: float  # [m]
    friction: float  # in the material callback: that of the pair, mixed of both bodies'
    restitution: float  # the same

class World:
    def __init__(self, settings: Optional[Settings] = None) -> None: ...
    def add(
        self,
        shape: Shape,
        kind: Kind = ...,
        *,
        position: Vector = ...,
        rotation: Vector = ...,
        linear_velocity: Vector = ...,
        angular_velocity: Vector = ...,
        mass: Optional[float] = None,
        inertia: Any = None,
        density: Optional[float] = None,  # [kg/m^3], 1 if no mass is given either
        friction: float = 0.5,
        restitution: float = 0.2,
        layers: int = 1,
        collides_with: int = 0xFFFFFFFF,
        sensor: bool = False,
        user_data: int = 0,
    ) -> int: ...
    def remove(self, body: int) -> None: ...  # from the next step on its number may be used again
    def id(self, body: int) -> BodyId: ...
    def lives(self, id: BodyId) -> bool: ...
    # What is left out is the identity, or zero.
    def teleport(self, body: int, position: Vector, rotation: Vector = (0, 0, 0, 1)) -> None: ...
    def set_velocity(self, body: int, linear: Vector, angular: Vector = (0, 0, 0)) -> None: ...
    # They stay until changed. Of a body that is not dynamic they wait until it is.
    def set_force(self, body: int, force: Vector, torque: Vector = (0, 0, 0)) -> None: ...
    # The same of many at once, a row each; all or, where one is bad, none.
    def set_velocities(self, bodies: Numbers, linear: Rows, angular: Optional[Rows] = None) -> None: ...
    def set_forces(self, bodies: Numbers, forces: Rows, torques: Optional[Rows] = None) -> None: ...
    # Sets the velocities that take a kinematic body there in a step of dt. They stay: call it before each step.
    def move_to(self, body: int, position: Vector, rotation: Vector, dt: float) -> None: ...
    def set_kind(self, body: int, kind: Kind) -> None: ...
    def set_mass(self, body: int, mass: float, inertia: Any = None) -> None: ...  # [kg m^2] (3, 3); without it, it changes with the mass
    def set_material(self, body: int, friction: float, restitution: float) -> None: ...
    def set_surface_velocity(self, body: int, velocity: Vector) -> None: ...  # [m/s] in its frame: a conveyor; its part along a normal counts for nothing
    def set_layers(self, body: int, layers: int, collides_with: int) -> None: ...
    def set_collision(self, body: int, other: int, collide: bool) -> None: ...
    def set_gravity(self, gravity: Vector) -> None: ...
    # Asked in step(), of any pair and any number of times, one at a time: they must depend on their arguments alone, and cost more than all
    # else. What they raise comes out of step(), and the world is as it was. None: no longer. Python's collector does not see through a
    # world: one whose callback holds the world, or an object that does, is freed after set_collision_callback(None).
    def set_collision_callback(self, callback: Optional[Callable[[int, int, Body, Body], bool]]) -> None: ...  # may a < b touch
    def set_material_callback(  # (friction, restitution) of a contact
        self, callback: Optional[Callable[[Contact, Body, Body], Tuple[float, float]]]
    ) -> None: ...
    def step(self, dt: float) -> StepReport: ...  # other Python threads run meanwhile
    def save(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...
    # Poses and velocities alone, 104 bytes a body, for worlds of Settings(stateless=True): what is saved is all that later steps depend on.
    def save_motion(self) -> bytes: ...
    def restore_motion(self, data: bytes) -> None: ...
    def check_initial_overlap(self) -> None: ...  # ValueError names two bodies and the depth; the next step() asks the same
    def shape(self, body: int) -> Shape: ...
    def kind(self, body: int) -> Kind: ...
    def friction(self, body: int) -> float: ...
    def restitution(self, body: int) -> float: ...
    def user_data(self, body: int) -> int: ...
    def set_user_data(self, body: int, data: int) -> None: ...
    @property
    def settings(self) -> Settings: ...  # a copy
    def __len__(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def state_hash(self) -> int: ...
    @property
    def positions(self) -> np.ndarray: ...  # (n, 3) [m], a view
    @property
    def rotations(self) -> np.ndarray: ...  # (n, 4), a view
    @property
    def linear_velocities(self) -> np.ndarray: ...  # (n, 3) [m/s], a view
    @property
    def angular_velocities(self) -> np.ndarray: ...  # (n, 3) [rad/s], a view
    @property
    def masses(self) -> np.ndarray: ...  # (n,) [kg], a view; 1 of what was never dynamic
    @property
    def frozen(self) -> np.ndarray: ...  # (n,) bool, a view
    @property
    def removed(self) -> np.ndarray: ...  # (n,) bool, a view
    # bodies (n, 2), features (n,), points, normals (n, 3), gaps (n,): touching as the last step left them. bodies and features name a contact.
    def contacts(self) -> Dict[str, np.ndarray]: ...
    # The same where impulses acted in the last step, and impulses (n, 3) [N s] on the second body: once in each piece of it, in the order of time.
    def impulses(self) -> Dict[str, np.ndarray]: ...
    def impulse_on(self, body: int) -> np.ndarray: ...  # (3,) [N s]
    def events(self) -> List[Tuple[str, int, int, bool]]: ...  # 'begin', 'persist' or 'end', two bodies, of a sensor
    # Bodies, point, impulse, approach [m/s] as the step began: 0 where a blow is handed on. What is over in a fraction of the step is none.
    def hits(self) -> List[Tuple[int, int, np.ndarray, np.ndarray, float]]: ...
    def cast_ray(
        self, origin: Vector, way: Vector, layers: int = 0xFFFFFFFF
    ) -> Optional[Tuple[int, float, np.ndarray, np.ndarray]]: ...  # body, share of the way, point, normal
    def cast_shape(
        self, shape: Shape, position: Vector, rotation: Vector, way: Vector, layers: int = 0xFFFFFFFF
    ) -> Optional[Tuple[int, float, np.ndarray, np.ndarray]]: ...  # the same, of a shape that moves along the way
    def overlapping(
        self, shape: Shape, position: Vector, rotation: Vector = (0, 0, 0, 1), layers: int = 0xFFFFFFFF
    ) -> List[int]: ...

def scenes() -> List[str]: ...
def scene(
    name: str,
    settings: Optional[Settings] = None,
    count: Optional[int] = None,
    seed: Optional[int] = None,
    friction: Optional[float] = None,
    restitution: Optional[float] = None,
) -> World: ...
