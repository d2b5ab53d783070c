"""Contact and friction among thousands of rigid bodies, exactly and fast.

Units are SI. Frames: W is the world. Rotations are (x, y, z, w), unit length, from a body's frame to W.
A bad value raises ValueError that names the field and the value; a world that is in a step raises RuntimeError.

Arrays that are properties of a world are read-only views of its memory: they show every later step, and while one of them lives
add() raises BufferError. Copy what is to stay.
"""
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

__version__: str

class Model:
    KINETIC: Model
    CONVEX: Model
    COULOMB: Model

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
    gravity: Any  # [m/s^2]
    model: Model
    freezing: Freezing
    freeze_seconds: float
    freeze_travel: float
    tolerance: float  # of the contact problems, relative to v_ref
    effort: Any  # 'quick', 'normal', 'thorough' or a number of sweeps
    touch_gap: float
    overlap_tolerance: float
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
    def box(half_extents: Sequence[float]) -> Shape: ...
    @staticmethod
    def half_space() -> Shape: ...  # below z = 0 of its frame
    @staticmethod
    def convex_hull(points: np.ndarray) -> Shape: ...  # (n, 3)
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
    value: float
    body: int

class Ledger:
    energy_created: LedgerEntry
    momentum_unexplained: LedgerEntry
    angular_momentum_unexplained: LedgerEntry
    displacement_without_velocity: LedgerEntry
    sides_changed: int
    @property
    def clean(self) -> bool: ...

class StepReport:
    contacts: int
    active_contacts: int
    awake: int
    frozen: int
    bounces: int
    penetration_max: float  # [m]
    kinetic_energy: float  # [J]
    energy_gain: float  # [J]
    certificate: Certificate
    ledger: Ledger
    @property
    def missed(self) -> int: ...  # problems that ended above the tolerance
    @property
    def failed(self) -> bool: ...  # the bodies did what physics does not allow

class Snapshot:
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(data: bytes) -> Snapshot: ...

class BodyId:
    number: int
    generation: int

class World:
    def __init__(self, settings: Optional[Settings] = None) -> None: ...
    def add(
        self,
        shape: Shape,
        kind: Kind = ...,
        *,
        position: Sequence[float] = ...,
        rotation: Sequence[float] = ...,
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
        mass: Optional[float] = None,
        inertia: Optional[np.ndarray] = None,
        density: float = 1.0,
        friction: float = 0.5,
        restitution: float = 0.2,
        layers: int = 1,
        collides_with: int = 0xFFFFFFFF,
        sensor: bool = False,
        user_data: int = 0,
    ) -> int: ...
    def remove(self, body: int) -> None: ...
    def id(self, body: int) -> BodyId: ...
    def lives(self, id: BodyId) -> bool: ...
    def teleport(self, body: int, position: Sequence[float], rotation: Sequence[float] = ...) -> None: ...
    def set_velocity(self, body: int, linear: Sequence[float], angular: Sequence[float] = ...) -> None: ...
    def set_force(self, body: int, force: Sequence[float], torque: Sequence[float] = ...) -> None: ...
    def move_to(self, body: int, position: Sequence[float], rotation: Sequence[float], dt: float) -> None: ...
    def set_kind(self, body: int, kind: Kind) -> None: ...
    def set_mass(self, body: int, mass: float) -> None: ...
    def set_material(self, body: int, friction: float, restitution: float) -> None: ...
    def set_layers(self, body: int, layers: int, collides_with: int) -> None: ...
    def set_collision(self, body: int, other: int, collide: bool) -> None: ...
    def set_gravity(self, gravity: Sequence[float]) -> None: ...
    def step(self, dt: float) -> StepReport: ...  # other Python threads run meanwhile
    def save(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...
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
    def masses(self) -> np.ndarray: ...  # (n,) [kg], a view
    @property
    def frozen(self) -> np.ndarray: ...  # (n,) bool, a view
    @property
    def removed(self) -> np.ndarray: ...  # (n,) bool, a view
    def contacts(self) -> Dict[str, np.ndarray]: ...  # bodies (n, 2), points, normals (n, 3), gaps (n,): touching now
    def impulses(self) -> Dict[str, np.ndarray]: ...  # of the last step; also impulses (n, 3) [N s] on the second body
    def impulse_on(self, body: int) -> np.ndarray: ...  # (3,) [N s]
    def events(self) -> List[Tuple[str, int, int, bool]]: ...  # 'begin', 'persist' or 'end', two bodies, of a sensor
    def hits(self) -> List[Tuple[int, int, np.ndarray, np.ndarray, float]]: ...  # bodies, point, impulse, approach [m/s]
    def cast_ray(
        self, origin: Sequence[float], way: Sequence[float], layers: int = 0xFFFFFFFF
    ) -> Optional[Tuple[int, float, np.ndarray, np.ndarray]]: ...  # body, share of the way, point, normal
    def overlapping(
        self, shape: Shape, position: Sequence[float], rotation: Sequence[float] = ..., layers: int = 0xFFFFFFFF
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
