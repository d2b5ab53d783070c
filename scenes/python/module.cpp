// islet for Python: `import islet`. What each name does is told by scenes/python/islet.pyi and by the C++ headers.
//
// Arrays of a world are views of its own memory, without copies. While one of them lives, no body can be added: the call is refused, as a
// bytearray refuses to grow while somebody looks at it. World.step runs without the interpreter's lock; whoever calls a world meanwhile gets RuntimeError.
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "engine/body_definition.h"
#include "engine/world.h"
#include "scenes/scene.h"

namespace py = pybind11;
using namespace islet;

namespace {

// What a callback throws while the interpreter ends.
struct Ended : std::runtime_error {
  Ended() : std::runtime_error("the interpreter ends") {}
};

// The interpreter's lock guards it: whoever has the lock sees a world that is in a step, or one that is in none.
class PyWorld {
 public:
  explicit PyWorld(World world) : world_(std::move(world)) {}

  World& world() {
    if (stepping_)
      throw std::runtime_error(
          "islet.World: the world is in a step, of another thread or of the caller of this callback");
    return world_;
  }

  // act(world) without the lock, for callbacks may run on other threads. No guard object takes it back: where the interpreter ends
  // meanwhile this thread is unwound from here.
  template <typename Act>
  void WithoutLock(const Act& act) {
    World& world = this->world();
    std::exception_ptr error;
    stepping_ = true;
    PyThreadState* const thread = PyEval_SaveThread();
    try {
      act(world);
    } catch (...) {
      error = std::current_exception();
    }
    PyEval_RestoreThread(thread);
    stepping_ = false;
    if (!error) return;
    try {
      std::rethrow_exception(error);
    } catch (const Ended&) {  // as sys.exit() in that thread: silent
      PyErr_SetNone(PyExc_SystemExit);
      throw py::error_already_set();
    }
  }

  StepReport Step(double dt) {
    StepReport report;
    WithoutLock([&](World& world) { report = world.Step(dt); });
    return report;
  }

  // What may move the bodies' memory.
  World& Growing(const char* call) {
    if (*views_ > 0)
      throw py::buffer_error(std::string("islet.World.") + call + ": " + std::to_string(*views_) +
                             " arrays of this world are in use; delete or copy them first");
    return world();
  }
  const std::shared_ptr<int>& views() const { return views_; }

 private:
  World world_;
  bool stepping_ = false;
  std::shared_ptr<int> views_ = std::make_shared<int>(0);  // arrays that look into it
};

using Row3 = std::array<double, 3>;
using Row4 = std::array<double, 4>;  // x, y, z, w
Vector3 ToVector(const Row3& row) { return {row[0], row[1], row[2]}; }
Quaternion ToRotation(const Row4& row) { return {row[3], row[0], row[1], row[2]}; }

// A read-only array of one field of all bodies. The world lives as long as the array.
template <typename Field>
py::array View(const py::object& self, Field Body::*field, const py::dtype& type, std::vector<py::ssize_t> row) {
  auto& owner = self.cast<PyWorld&>();
  const std::span<const Body> bodies = owner.world().bodies();
  struct Lease {
    py::object world;
    std::shared_ptr<int> views;
  };
  auto* lease = new Lease{self, owner.views()};
  ++*owner.views();
  const py::capsule base(lease, [](void* held) {
    auto* of = static_cast<Lease*>(held);
    --*of->views;
    delete of;
  });
  static const Body none;
  const Field& first = (bodies.empty() ? none : bodies[0]).*field;
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(bodies.size())},
      strides{static_cast<py::ssize_t>(sizeof(Body))};
  for (const py::ssize_t extent : row) shape.push_back(extent), strides.push_back(type.itemsize());
  py::array array(type, shape, strides, &first, base);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

template <typename T>
py::array_t<T> NewArray(size_t rows, size_t columns) {
  return columns == 1 ? py::array_t<T>(std::vector<size_t>{rows}) : py::array_t<T>(std::vector<size_t>{rows, columns});
}

// Of contacts: arrays of their own, for the next step replaces the contacts.
py::dict Contacts(std::span<const Contact> contacts, const Vector3* impulses) {
  auto bodies = NewArray<int>(contacts.size(), 2);
  auto features = NewArray<std::uint32_t>(contacts.size(), 1);
  auto points = NewArray<double>(contacts.size(), 3), normals = NewArray<double>(contacts.size(), 3),
       forces = NewArray<double>(contacts.size(), 3), gaps = NewArray<double>(contacts.size(), 1);
  for (size_t c = 0; c < contacts.size(); ++c) {
    bodies.mutable_data(c, 0)[0] = contacts[c].body_a;
    bodies.mutable_data(c, 0)[1] = contacts[c].body_b;
    features.mutable_data()[c] = contacts[c].feature;
    gaps.mutable_data()[c] = contacts[c].gap;
    for (int k = 0; k < 3; ++k) {
      points.mutable_data(c, 0)[k] = contacts[c].point_W[k];
      normals.mutable_data(c, 0)[k] = contacts[c].normal_W[k];
      if (impulses) forces.mutable_data(c, 0)[k] = impulses[c][k];
    }
  }
  py::dict result;
  result["bodies"] = bodies;
  result["features"] = features;
  result["points"] = points;
  result["normals"] = normals;
  result["gaps"] = gaps;
  if (impulses) result["impulses"] = forces;
  return result;
}

// The number, if a body has it.
int Live(PyWorld& self, int body) { return self.world().id(body).number; }

using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;

// set(body, linear, angular) for each row, once all of them are known to be good: a bad one changes nothing.
template <typename Check, typename Set>
void SetRows(const char* call, std::array<const char*, 2> names, const py::object& of, const Rows& linear,
             const std::optional<Rows>& angular, const Check& check, const Set& set) {
  const py::array numbers(of);
  if (numbers.size() > 0 && numbers.dtype().kind() != 'i' && numbers.dtype().kind() != 'u')
    throw std::invalid_argument(std::string(call) + ": bodies must be whole numbers");
  const py::array_t<std::int64_t, py::array::forcecast> bodies(numbers);
  if (bodies.ndim() != 1) throw std::invalid_argument(std::string(call) + ": bodies must have shape (n,)");
  const py::ssize_t n = bodies.shape(0);
  const auto row = [](const Rows& rows, py::ssize_t i) { return Vector3(rows.at(i, 0), rows.at(i, 1), rows.at(i, 2)); };
  const auto require = [&](const char* field, const Rows& rows) {
    if (n == 0 && rows.size() == 0) return;  // also an empty list
    if (rows.ndim() != 2 || rows.shape(0) != n || rows.shape(1) != 3)
      throw std::invalid_argument(std::string(call) + ": " + field + " must have shape (" + std::to_string(n) +
                                  ", 3), a row for each of bodies");
    for (py::ssize_t i = 0; i < n; ++i)
      RequireFinite(call, std::string(field) + " of body " + std::to_string(bodies.at(i)), row(rows, i));
  };
  require(names[0], linear);
  if (angular) require(names[1], *angular);
  const auto number = [&](py::ssize_t i) {
    const std::int64_t body = bodies.at(i);
    if (body < 0 || body > std::numeric_limits<int>::max())
      throw std::invalid_argument(std::string(call) + ": there is no body " + std::to_string(body));
    return static_cast<int>(body);
  };
  const auto second = [&](py::ssize_t i) -> Vector3 { return angular ? row(*angular, i) : Vector3::Zero(); };
  for (py::ssize_t i = 0; i < n; ++i) check(number(i), row(linear, i), second(i));
  for (py::ssize_t i = 0; i < n; ++i) set(number(i), row(linear, i), second(i));
}

const char* KindName(ContactEventKind kind) {
  return kind == ContactEventKind::kBegin ? "begin" : kind == ContactEventKind::kPersist ? "persist" : "end";
}

py::bytes BytesOf(const WorldSnapshot& snapshot) {
  const std::vector<std::byte> bytes = snapshot.ToBytes();
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
WorldSnapshot SnapshotOf(const py::bytes& data) {
  const std::string_view bytes = data;
  return WorldSnapshot::FromBytes({reinterpret_cast<const std::byte*>(bytes.data()), bytes.size()});
}

py::bytes MotionOf(PyWorld& self) {
  const std::vector<std::byte> bytes = self.world().SaveMotion();
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

using CollisionFunction = std::function<py::object(int a, int b, const Body& body_a, const Body& body_b)>;
// What a callback returned, checked by the world.
using MaterialFunction = std::function<std::pair<double, double>(const Contact& contact, const Body& a, const Body& b)>;

// A callback that waits for the lock of an interpreter that ends would be unwound through the engine. So who begins one later is refused, and
// the end waits for those that have begun: for a second at most, since some may wait for the end.
class Callback {
 public:
  Callback() {
    ++under_way_;
    if (!ending_) return;
    --under_way_;
    throw Ended();
  }
  ~Callback() { --under_way_; }
  Callback(const Callback&) = delete;
  Callback& operator=(const Callback&) = delete;

  static void End() {
    ending_ = true;
    const py::gil_scoped_release unlock;
    const auto begin = std::chrono::steady_clock::now();
    while (under_way_ > 0 && std::chrono::steady_clock::now() < begin + std::chrono::seconds(1))
      std::this_thread::yield();
  }

 private:
  static inline std::atomic<bool> ending_ = false;
  static inline std::atomic<int> under_way_ = 0;
};

// What Python's function returned; if it is of another type, an error that says whose and what it must be.
template <typename Call>
auto Returned(const char* whose, const char* what, const Call& call) -> decltype(call()) {
  const Callback begun;
  try {
    return call();
  } catch (const py::cast_error&) {
    throw py::type_error(std::string(whose) + " must return " + what);
  }
}

Shape HullOf(const py::array_t<double, py::array::c_style | py::array::forcecast>& points) {
  if (points.ndim() != 2 || points.shape(1) != 3)
    throw std::invalid_argument("convex_hull: points must have shape (n, 3)");
  std::vector<Vector3> list;
  for (py::ssize_t i = 0; i < points.shape(0); ++i)
    list.emplace_back(points.at(i, 0), points.at(i, 1), points.at(i, 2));
  return Shape::ConvexHull(list);
}

void BindSettings(py::module_& m) {
  py::enum_<Model>(m, "Model")
      .value("KINETIC", Model::kKinetic)
      .value("CONVEX", Model::kConvex)
      .value("COULOMB", Model::kCoulomb);
  py::enum_<Cone>(m, "Cone").value("CIRCULAR", Cone::kCircular).value("OCTAGON", Cone::kOctagon);
  py::enum_<BounceLaw>(m, "BounceLaw")
      .value("EQ5", BounceLaw::kEq5)
      .value("EQ6", BounceLaw::kEq6)
      .value("EXACT", BounceLaw::kExact);
  py::enum_<Freezing>(m, "Freezing")
      .value("OFF", Freezing::kOff)
      .value("PAPER", Freezing::kPaper)
      .value("CERTIFIED", Freezing::kCertified);
  const auto of_fields = [](const py::dict& fields) {
    py::object settings = py::cast(Settings{});
    for (const auto& [name, value] : fields) {
      if (!py::hasattr(settings, name)) throw py::type_error("Settings has no field " + py::cast<std::string>(name));
      settings.attr(name) = value;
    }
    settings.cast<Settings&>().Validate();
    return settings.cast<Settings>();
  };
  py::class_<Settings>(m, "Settings")
      .def(py::init([of_fields](const py::kwargs& fields) { return of_fields(fields); }))
      .def(py::pickle(
          [](const py::object& self) {
            py::dict fields;
            const py::object type = py::type::of(self);
            for (const py::handle name : type.attr("__dict__"))
              if (PyObject_TypeCheck(type.attr(name).ptr(), &PyProperty_Type)) fields[name] = self.attr(name);
            return fields;
          },
          of_fields))
      .def_property(
          "gravity", [](const Settings& s) { return py::make_tuple(s.gravity.x(), s.gravity.y(), s.gravity.z()); },
          [](Settings& s, const Row3& g) { s.gravity = ToVector(g); })
      .def_readwrite("model", &Settings::model)
      .def_readwrite("freezing", &Settings::freezing)
      .def_readwrite("freeze_seconds", &Settings::freeze_seconds)
      .def_readwrite("freeze_travel", &Settings::freeze_travel)
      .def_readwrite("tolerance", &Settings::tolerance)
      .def_property(
          "effort",
          [](const Settings& s) -> py::object {
            if (s.effort.newton) return py::str("thorough");
            return py::int_(s.effort.sweeps);
          },
          [](Settings& s, const py::object& effort) {
            if (!py::isinstance<py::str>(effort)) {
              const py::object number = py::reinterpret_steal<py::object>(PyNumber_Index(effort.ptr()));
              if (!number) throw py::error_already_set();
              const long long sweeps = PyLong_AsLongLong(number.ptr());
              if (PyErr_Occurred() || sweeps < 1 || sweeps > 1'000'000) {
                PyErr_Clear();
                throw std::invalid_argument("effort = " + std::string(py::str(number)) +
                                            " sweeps must lie in 1 to 1000000");
              }
              s.effort = {static_cast<int>(sweeps), false};
              return;
            }
            const std::string name = py::str(effort);
            if (name == "quick")
              s.effort = qp::kQuickEffort;
            else if (name == "normal")
              s.effort = qp::kNormalEffort;
            else if (name == "thorough")
              s.effort = qp::kThoroughEffort;
            else
              throw std::invalid_argument("effort = '" + name +
                                          "' must be 'quick', 'normal', 'thorough' or a number of sweeps");
          })
      .def_readwrite("cone", &Settings::cone)
      .def_readwrite("bounce_law", &Settings::bounce_law)
      .def_readwrite("freeze_count", &Settings::freeze_count)
      .def_readwrite("bounce_limit", &Settings::bounce_limit)
      .def_readwrite("touch_gap", &Settings::touch_gap)
      .def_readwrite("overlap_tolerance", &Settings::overlap_tolerance)
      .def_readwrite("stateless", &Settings::stateless)
      .def_readwrite("threads", &Settings::threads)
      .def_readwrite("group_bodies", &Settings::group_bodies)
      .def_static("paper", &Settings::Paper);
}

void BindReport(py::module_& m) {
  py::class_<Certificate>(m, "Certificate")
      .def_readonly("momentum", &Certificate::momentum)
      .def_readonly("cone", &Certificate::cone)
      .def_readonly("dual", &Certificate::dual)
      .def_readonly("gap", &Certificate::gap)
      .def_readonly("coulomb_map_max", &Certificate::coulomb_map_max)
      .def_readonly("coulomb_map_rms", &Certificate::coulomb_map_rms);
  py::class_<LedgerEntry>(m, "LedgerEntry")
      .def_readonly("value", &LedgerEntry::value)
      .def_readonly("body", &LedgerEntry::body);
  py::class_<Ledger>(m, "Ledger")
      .def_readonly("energy_created", &Ledger::energy_created)
      .def_readonly("momentum_unexplained", &Ledger::momentum_unexplained)
      .def_readonly("angular_momentum_unexplained", &Ledger::angular_momentum_unexplained)
      .def_readonly("displacement_without_velocity", &Ledger::displacement_without_velocity)
      .def_readonly("sides_changed", &Ledger::sides_changed)
      .def_property_readonly("clean", &Ledger::Clean);
  py::class_<StepReport>(m, "StepReport")
      .def_readonly("contacts", &StepReport::contacts)
      .def_readonly("active_contacts", &StepReport::active_contacts)
      .def_readonly("awake", &StepReport::awake)
      .def_readonly("frozen", &StepReport::frozen)
      .def_readonly("woken", &StepReport::woken)
      .def_readonly("newly_frozen", &StepReport::newly_frozen)
      .def_readonly("bounces", &StepReport::bounces)
      .def_readonly("restitution_lowered", &StepReport::restitution_lowered)
      .def_readonly("pieces", &StepReport::pieces)
      .def_readonly("penetration_max", &StepReport::penetration_max)
      .def_readonly("kinetic_energy", &StepReport::kinetic_energy)
      .def_readonly("energy_gain", &StepReport::energy_gain)
      .def_readonly("certificate", &StepReport::certificate)
      .def_readonly("ledger", &StepReport::ledger)
      .def_property_readonly("missed", [](const StepReport& r) { return r.collision_qp.missed + r.static_qp.missed; })
      .def_property_readonly("unsolved", [](const StepReport& r) { return r.collision_qp.failed + r.static_qp.failed; })
      .def_readonly("unstepped", &StepReport::unstepped)
      .def_readonly("overlapping", &StepReport::overlapping)
      .def_readonly("motion_failures", &StepReport::motion_failures)
      .def_readonly("gave_up", &StepReport::gave_up)
      .def_property_readonly("failed", &StepReport::Failed)
      .def("__repr__", [](const StepReport& r) {
        return "<islet.StepReport: " + std::to_string(r.contacts) + " contacts, " + std::to_string(r.awake) +
               " awake, " + std::to_string(r.frozen) + " frozen" + (r.Failed() ? ", failed>" : ">");
      });
}

void BindWorld(py::module_& m) {
  py::enum_<BodyKind>(m, "Kind")
      .value("FIXED", BodyKind::kFixed)
      .value("KINEMATIC", BodyKind::kKinematic)
      .value("DYNAMIC", BodyKind::kDynamic);
  py::class_<Shape>(m, "Shape")
      .def("__copy__", [](const py::object& self) { return self; })  // nothing changes it
      .def("__deepcopy__", [](const py::object& self, const py::dict&) { return self; })
      .def_static("sphere", &Shape::Sphere, py::arg("radius"))
      .def_static(
          "box", [](const Row3& half) { return Shape::Box(ToVector(half)); }, py::arg("half_extents"))
      .def_static("half_space", &Shape::HalfSpace)
      .def_static("capsule", &Shape::Capsule, py::arg("radius"), py::arg("half_length"))
      .def_static("cylinder", &Shape::Cylinder, py::arg("radius"), py::arg("half_length"))
      .def_static("convex_hull", &HullOf, py::arg("points"))
      .def_property_readonly("hull_offset", [](const Shape& shape) { return shape.hull_offset(); })
      .def_property_readonly("vertices",
                             [](const Shape& shape) {
                               const std::vector<Vector3>& vertices = shape.polytope().vertices;
                               auto rows = NewArray<double>(vertices.size(), 3);
                               for (size_t v = 0; v < vertices.size(); ++v)
                                 for (int k = 0; k < 3; ++k) rows.mutable_data(v, 0)[k] = vertices[v][k];
                               return rows;
                             })
      .def_property_readonly("volume", &Shape::Volume)
      .def_property_readonly("radius", &Shape::radius);
  py::class_<WorldSnapshot>(m, "Snapshot")
      .def("to_bytes", &BytesOf)
      .def_static("from_bytes", &SnapshotOf, py::arg("data"))
      .def(py::pickle(&BytesOf, &SnapshotOf));
  py::class_<BodyId>(m, "BodyId")
      .def_readonly("number", &BodyId::number)
      .def_readonly("generation", &BodyId::generation)
      .def(py::pickle([](const BodyId& id) { return py::make_tuple(id.number, id.generation); },
                      [](const py::tuple& of) {
                        return BodyId{of[0].cast<int>(), of[1].cast<std::uint32_t>()};
                      }))
      .def(py::self == py::self)
      .def("__hash__", [](const BodyId& id) { return py::hash(py::make_tuple(id.number, id.generation)); })
      .def("__repr__", [](const BodyId& id) {
        return "<islet.BodyId: " + std::to_string(id.number) + ", generation " + std::to_string(id.generation) + ">";
      });
  py::class_<Body>(m, "Body")
      .def_readonly("position", &Body::position_W)
      .def_property_readonly("rotation", [](const Body& body) -> Eigen::Vector4d { return body.rotation_WB.coeffs(); })
      .def_readonly("linear_velocity", &Body::linear_velocity_W)
      .def_readonly("angular_velocity", &Body::angular_velocity_W)
      .def_readonly("kind", &Body::kind)
      .def_readonly("friction", &Body::friction)
      .def_readonly("restitution", &Body::restitution);
  py::class_<Contact>(m, "Contact")
      .def_readonly("body_a", &Contact::body_a)
      .def_readonly("body_b", &Contact::body_b)
      .def_readonly("point", &Contact::point_W)
      .def_readonly("normal", &Contact::normal_W)
      .def_readonly("gap", &Contact::gap)
      .def_readonly("friction", &Contact::friction)
      .def_readonly("restitution", &Contact::restitution);
  const auto numbers = py::dtype::of<double>();
  py::class_<PyWorld>(m, "World")
      .def(py::init([](const std::optional<Settings>& settings) {
             return std::make_unique<PyWorld>(PyWorld(World(settings.value_or(Settings{}))));
           }),
           py::arg("settings") = py::none())
      .def(
          "add",
          [](PyWorld& self, const Shape& shape, BodyKind kind, const Row3& position, const Row4& rotation,
             const Row3& linear, const Row3& angular, std::optional<double> mass, std::optional<Matrix3> inertia,
             std::optional<double> density, double friction, double restitution, std::uint32_t layers,
             std::uint32_t collides_with, bool sensor, std::uint64_t user_data) {
            if (mass && density) throw py::value_error("add: mass and density: give one of them");
            return self.Growing("add").Add({.shape = shape,
                                            .kind = kind,
                                            .mass = mass,
                                            .inertia_B = inertia,
                                            .density = density.value_or(1),
                                            .position_W = ToVector(position),
                                            .rotation_WB = ToRotation(rotation),
                                            .linear_velocity_W = ToVector(linear),
                                            .angular_velocity_W = ToVector(angular),
                                            .friction = friction,
                                            .restitution = restitution,
                                            .layers = layers,
                                            .collides_with = collides_with,
                                            .sensor = sensor,
                                            .user_data = user_data});
          },
          py::arg("shape"), py::arg("kind") = BodyKind::kDynamic, py::kw_only(), py::arg("position") = Row3{},
          py::arg("rotation") = Row4{0, 0, 0, 1}, py::arg("linear_velocity") = Row3{},
          py::arg("angular_velocity") = Row3{}, py::arg("mass") = py::none(), py::arg("inertia") = py::none(),
          py::arg("density") = py::none(), py::arg("friction") = 0.5, py::arg("restitution") = 0.2,
          py::arg("layers") = 1u, py::arg("collides_with") = 0xffffffffu, py::arg("sensor") = false,
          py::arg("user_data") = 0)
      .def(
          "remove", [](PyWorld& self, int body) { self.world().Remove(body); }, py::arg("body"))
      .def(
          "id", [](PyWorld& self, int body) { return self.world().id(body); }, py::arg("body"))
      .def(
          "lives", [](PyWorld& self, BodyId id) { return self.world().Lives(id); }, py::arg("id"))
      .def(
          "teleport",
          [](PyWorld& self, int body, const Row3& p, const Row4& r) {
            self.world().Teleport(body, ToVector(p), ToRotation(r));
          },
          py::arg("body"), py::arg("position"), py::arg("rotation") = Row4{0, 0, 0, 1})
      .def(
          "set_velocity",
          [](PyWorld& self, int body, const Row3& v, const Row3& w) {
            self.world().SetVelocity(body, ToVector(v), ToVector(w));
          },
          py::arg("body"), py::arg("linear"), py::arg("angular") = Row3{})
      .def(
          "set_force",
          [](PyWorld& self, int body, const Row3& f, const Row3& t) {
            self.world().SetForce(body, ToVector(f), ToVector(t));
          },
          py::arg("body"), py::arg("force"), py::arg("torque") = Row3{})
      .def(
          "set_velocities",
          [](PyWorld& self, const py::object& bodies, const Rows& linear, const std::optional<Rows>& angular) {
            const auto check = [&](int body, const Vector3& v, const Vector3& w) {
              if (self.world().body(Live(self, body)).kind == BodyKind::kFixed && !(v.isZero(0) && w.isZero(0)))
                throw std::invalid_argument("set_velocities: body " + std::to_string(body) + " is fixed");
            };
            SetRows("set_velocities", {"linear", "angular"}, bodies, linear, angular, check,
                    [&](int body, const Vector3& v, const Vector3& w) { self.world().SetVelocity(body, v, w); });
          },
          py::arg("bodies"), py::arg("linear"), py::arg("angular") = py::none())
      .def(
          "set_forces",
          [](PyWorld& self, const py::object& bodies, const Rows& forces, const std::optional<Rows>& torques) {
            SetRows(
                "set_forces", {"forces", "torques"}, bodies, forces, torques,
                [&](int body, const Vector3&, const Vector3&) { Live(self, body); },
                [&](int body, const Vector3& f, const Vector3& t) { self.world().SetForce(body, f, t); });
          },
          py::arg("bodies"), py::arg("forces"), py::arg("torques") = py::none())
      .def(
          "move_to",
          [](PyWorld& self, int body, const Row3& p, const Row4& r, double dt) {
            self.world().MoveTo(body, ToVector(p), ToRotation(r), dt);
          },
          py::arg("body"), py::arg("position"), py::arg("rotation"), py::arg("dt"))
      .def(
          "set_kind", [](PyWorld& self, int body, BodyKind kind) { self.world().SetKind(body, kind); }, py::arg("body"),
          py::arg("kind"))
      .def(
          "set_mass",
          [](PyWorld& self, int body, double mass, const std::optional<Matrix3>& inertia) {
            inertia ? self.world().SetMass(body, mass, *inertia) : self.world().SetMass(body, mass);
          },
          py::arg("body"), py::arg("mass"), py::arg("inertia") = py::none())
      .def(
          "set_material",
          [](PyWorld& self, int body, double friction, double restitution) {
            self.world().SetMaterial(body, friction, restitution);
          },
          py::arg("body"), py::arg("friction"), py::arg("restitution"))
      .def(
          "set_surface_velocity",
          [](PyWorld& self, int body, const Row3& velocity) {
            self.world().SetSurfaceVelocity(body, ToVector(velocity));
          },
          py::arg("body"), py::arg("velocity"))
      .def(
          "set_layers",
          [](PyWorld& self, int body, std::uint32_t layers, std::uint32_t with) {
            self.world().SetLayers(body, layers, with);
          },
          py::arg("body"), py::arg("layers"), py::arg("collides_with"))
      .def(
          "set_collision", [](PyWorld& self, int a, int b, bool collide) { self.world().SetCollision(a, b, collide); },
          py::arg("body"), py::arg("other"), py::arg("collide"))
      .def(
          "set_gravity", [](PyWorld& self, const Row3& g) { self.world().SetGravity(ToVector(g)); }, py::arg("gravity"))
      .def(
          "set_collision_callback",
          [](PyWorld& self, CollisionFunction callback) {
            if (!callback) return self.world().SetCollisionCallback(nullptr);
            self.world().SetCollisionCallback([callback = std::move(callback)](auto&&... of_pair) {
              return Returned("the collision callback", "a bool", [&] {
                const py::gil_scoped_acquire lock;
                const py::object may = callback(of_pair...);
                if (may.is_none()) throw py::cast_error("None");  // a forgotten return is no answer
                return may.cast<bool>();
              });
            });
          },
          py::arg("callback"))
      .def(
          "set_material_callback",
          [](PyWorld& self, MaterialFunction callback) {
            if (!callback) return self.world().SetMaterialCallback(nullptr);
            self.world().SetMaterialCallback([callback = std::move(callback)](const Contact& contact, const Body& a,
                                                                              const Body& b) -> Material {
              const auto [friction, restitution] =
                  Returned("the material callback", "(friction, restitution)", [&] { return callback(contact, a, b); });
              return {friction, restitution};
            });
          },
          py::arg("callback"))
      .def("step", &PyWorld::Step, py::arg("dt"))
      .def("save", [](PyWorld& self) { return self.world().Save(); })
      .def(
          "restore", [](PyWorld& self, const WorldSnapshot& snapshot) { self.Growing("restore").Restore(snapshot); },
          py::arg("snapshot"))
      .def("save_motion", &MotionOf)
      .def(
          "restore_motion",
          [](PyWorld& self, const py::bytes& data) {
            const std::string_view bytes = data;
            self.world().RestoreMotion({reinterpret_cast<const std::byte*>(bytes.data()), bytes.size()});
          },
          py::arg("data"))
      .def("check_initial_overlap",
           [](PyWorld& self) { self.WithoutLock([](World& world) { world.CheckInitialOverlap(); }); })
      .def(
          "shape", [](PyWorld& self, int body) { return self.world().shape(Live(self, body)); }, py::arg("body"))
      .def(
          "kind", [](PyWorld& self, int body) { return self.world().body(Live(self, body)).kind; }, py::arg("body"))
      .def(
          "friction", [](PyWorld& self, int body) { return self.world().body(Live(self, body)).friction; },
          py::arg("body"))
      .def(
          "restitution", [](PyWorld& self, int body) { return self.world().body(Live(self, body)).restitution; },
          py::arg("body"))
      .def(
          "user_data", [](PyWorld& self, int body) { return self.world().user_data(body); }, py::arg("body"))
      .def(
          "set_user_data", [](PyWorld& self, int body, std::uint64_t data) { self.world().SetUserData(body, data); },
          py::arg("body"), py::arg("data"))
      .def_property_readonly("settings", [](PyWorld& self) { return self.world().settings(); })
      .def("__len__", [](PyWorld& self) { return self.world().bodies().size(); })
      .def_property_readonly("time", [](PyWorld& self) { return self.world().time(); })
      .def_property_readonly("state_hash", [](PyWorld& self) { return self.world().StateHash(); })
      .def_property_readonly("positions",
                             [numbers](const py::object& self) { return View(self, &Body::position_W, numbers, {3}); })
      .def_property_readonly("rotations",
                             [numbers](const py::object& self) { return View(self, &Body::rotation_WB, numbers, {4}); })
      .def_property_readonly(
          "linear_velocities",
          [numbers](const py::object& self) { return View(self, &Body::linear_velocity_W, numbers, {3}); })
      .def_property_readonly(
          "angular_velocities",
          [numbers](const py::object& self) { return View(self, &Body::angular_velocity_W, numbers, {3}); })
      .def_property_readonly("masses",
                             [numbers](const py::object& self) { return View(self, &Body::mass, numbers, {}); })
      .def_property_readonly(
          "frozen", [](const py::object& self) { return View(self, &Body::frozen, py::dtype::of<bool>(), {}); })
      .def_property_readonly(
          "removed", [](const py::object& self) { return View(self, &Body::removed, py::dtype::of<bool>(), {}); })
      .def("contacts", [](PyWorld& self) { return Contacts(self.world().contacts(), nullptr); })
      .def("impulses",
           [](PyWorld& self) {
             static const Vector3 none;
             const std::span<const Vector3> impulses = self.world().impulses();
             return Contacts(self.world().resolved_contacts(), impulses.empty() ? &none : impulses.data());
           })
      .def(
          "impulse_on", [](PyWorld& self, int body) { return self.world().ImpulseOn(body); }, py::arg("body"))
      .def("events",
           [](PyWorld& self) {
             py::list list;
             for (const ContactEvent& e : self.world().events())
               list.append(py::make_tuple(KindName(e.kind), e.body_a, e.body_b, e.sensor));
             return list;
           })
      .def("hits",
           [](PyWorld& self) {
             py::list list;
             for (const HitEvent& h : self.world().hits())
               list.append(py::make_tuple(h.body_a, h.body_b, h.point_W, h.impulse_W, h.approach));
             return list;
           })
      .def(
          "cast_ray",
          [](PyWorld& self, const Row3& origin, const Row3& way, std::uint32_t layers) -> py::object {
            const auto hit = self.world().CastRay(ToVector(origin), ToVector(way), layers);
            if (!hit) return py::none();
            return py::make_tuple(hit->body, hit->share, hit->point_W, hit->normal_W);
          },
          py::arg("origin"), py::arg("way"), py::arg("layers") = 0xffffffffu)
      .def(
          "cast_shape",
          [](PyWorld& self, const Shape& shape, const Row3& p, const Row4& r, const Row3& way,
             std::uint32_t layers) -> py::object {
            const auto hit = self.world().CastShape(shape, ToVector(p), ToRotation(r), ToVector(way), layers);
            if (!hit) return py::none();
            return py::make_tuple(hit->body, hit->share, hit->point_W, hit->normal_W);
          },
          py::arg("shape"), py::arg("position"), py::arg("rotation"), py::arg("way"), py::arg("layers") = 0xffffffffu)
      .def(
          "overlapping",
          [](PyWorld& self, const Shape& shape, const Row3& p, const Row4& r, std::uint32_t layers) {
            return self.world().Overlapping(shape, ToVector(p), ToRotation(r), layers);
          },
          py::arg("shape"), py::arg("position"), py::arg("rotation") = Row4{0, 0, 0, 1},
          py::arg("layers") = 0xffffffffu);
}

}  // namespace

PYBIND11_MODULE(islet, m) {
  m.doc() = "Contact and friction among thousands of rigid bodies, exactly and fast.";
  m.attr("__version__") = ISLET_VERSION;
  py::module_::import("atexit").attr("register")(py::cpp_function(&Callback::End));
  BindSettings(m);
  BindReport(m);
  BindWorld(m);
  m.def("scenes", [] {
    std::vector<std::string> names;
    for (const Scene& scene : AllScenes()) names.emplace_back(scene.name);
    return names;
  });
  m.def(
      "scene",
      [](const std::string& name, const std::optional<Settings>& settings, std::optional<int> count,
         std::optional<std::uint64_t> seed, std::optional<double> friction, std::optional<double> restitution) {
        const Scene* scene = FindScene(name);
        if (!scene)
          throw std::invalid_argument("scene '" + name + "' is unknown; nearest is '" +
                                      std::string(NearestScene(name)) + "'");
        return std::make_unique<PyWorld>(
            PyWorld(BuildScene(*scene, {.count = count, .seed = seed, .friction = friction, .restitution = restitution},
                               settings.value_or(Settings{}))
                        .world));
      },
      py::arg("name"), py::arg("settings") = py::none(), py::arg("count") = py::none(), py::arg("seed") = py::none(),
      py::arg("friction") = py::none(), py::arg("restitution") = py::none());
}
