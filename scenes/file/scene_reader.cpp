#include "scenes/file/scene_reader.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "engine/rotation.h"
#include "scenes/file/mesh_file.h"
#include "scenes/file/number_format.h"
#include "scenes/file/placing.h"
#include "scenes/nearest_name.h"
#include "scenes/setting_names.h"

namespace islet {
namespace {

constexpr double kMostLength = 1e6;       // [m] of a shape
constexpr double kLongestRun = 1e6;       // [s]
constexpr size_t kMostEntries = 200'000;  // of an array whose entries are objects
constexpr size_t kMostRows = 100'000;     // of a table

struct Coefficients {
  double friction = 0.5, restitution = 0.2;
};

template <typename T, size_t n>
T Chosen(const Field& field, const std::array<std::pair<const char*, T>, n>& choices) {
  std::array<const char*, n> names;
  for (size_t i = 0; i < n; ++i) names[i] = choices[i].first;
  return choices[field.Choice(names)].second;
}

double Friction(const Field& field) { return field.Number(0, 1e4); }
double Restitution(const Field& field) { return field.Number(0, 1); }

Vector3 Sizes(const Field& field, double share) {
  const std::vector<Field> items = field.Items(3, 3);
  return {share * items[0].Positive(kMostLength), share * items[1].Positive(kMostLength),
          share * items[2].Positive(kMostLength)};
}

Region ReadRegion(const Field& field) {
  const Fields region(field, {"lower", "upper"});
  const Region read{region.Need("lower").Vector(), region.Need("upper").Vector()};
  for (int k = 0; k < 3; ++k)
    if (read.lower[k] > read.upper[k])
      field.Refuse("\"lower\" must be below \"upper\" in x, y and z; got " + ShortNumber(read.lower[k]) + " and " +
                   ShortNumber(read.upper[k]) + " in " + "xyz"[k]);
  return read;
}

// Four numbers, w first; or an axis and an angle.
Quaternion ReadRotation(const Field& field) {
  if (field.kind() == JsonKind::kArray) {
    const std::vector<Field> items = field.Items(4, 4);
    const Quaternion q(items[0].Number(-1, 1), items[1].Number(-1, 1), items[2].Number(-1, 1), items[3].Number(-1, 1));
    if (!(std::abs(q.norm() - 1) < 1e-6))
      field.Refuse("must be a quaternion of length 1; got " + ShortNumber(q.norm()));
    return q;
  }
  if (field.kind() != JsonKind::kObject) field.Fail("must be a quaternion [w, x, y, z] or an axis and an angle");
  const Fields turn(field, {"axis", "degrees", "radians"});
  const Vector3 axis = turn.Need("axis").UnitVector();
  const std::string_view unit = turn.One({"degrees", "radians"});
  const double angle = turn.Need(unit).Number(-1e6, 1e6);
  return Exp((unit == "degrees" ? angle * std::numbers::pi / 180 : angle) * axis);
}

Matrix3 ReadInertia(const Field& field) {
  const std::vector<Field> rows = field.Items(3, 3);
  Matrix3 inertia = Matrix3::Zero();
  for (int r = 0; r < 3; ++r) {
    if (rows[0].kind() == JsonKind::kArray) {
      inertia.row(r) = rows[r].Vector().transpose();
    } else {
      inertia(r, r) = rows[r].Positive();
    }
  }
  return inertia;
}

std::uint32_t ReadLayers(const Field& field) {
  std::uint32_t bits = 0;
  for (const Field& layer : field.Items(0, 32)) bits |= std::uint32_t{1} << layer.Whole(0, 31);
  return bits;
}

// A number, {"table": [[time, value], ...]} or {"sine": {...}}.
TimeFunction ReadFunction(const Field& field) {
  TimeFunction function;
  if (field.kind() == JsonKind::kNumber) {
    function.constant = field.Number(-1e30, 1e30);
    return function;
  }
  if (field.kind() != JsonKind::kObject) field.Fail("must be a number, a \"table\" or a \"sine\"");
  const Fields given(field, {"table", "sine"});
  if (given.One({"table", "sine"}) == "table") {
    for (const Field& row : given.Need("table").Items(1, kMostRows)) {
      const std::vector<Field> pair = row.Items(2, 2);
      const double time = pair[0].Number(-kLongestRun, kLongestRun);
      if (!function.table.empty() && !(time > function.table.back()[0]))
        pair[0].Fail("times must ascend from row to row");
      function.table.push_back({time, pair[1].Number(-1e30, 1e30)});
    }
    return function;
  }
  const Fields sine(given.Need("sine"), {"amplitude", "frequency", "phase", "offset"});
  function.amplitude = sine.Need("amplitude").Number(-1e30, 1e30);
  function.frequency = sine.Need("frequency").Number(0, 1e6);
  if (const auto phase = sine.Get("phase")) function.phase = phase->Number(-1e6, 1e6);
  if (const auto offset = sine.Get("offset")) function.constant = offset->Number(-1e30, 1e30);
  return function;
}

TimeVector ReadFunctions(const Field& field) {
  const std::vector<Field> items = field.Items(3, 3);
  return {ReadFunction(items[0]), ReadFunction(items[1]), ReadFunction(items[2])};
}

class SceneReader {
 public:
  explicit SceneReader(std::shared_ptr<const Document> document) { scene_.document = std::move(document); }

  SceneDescription Read() {
    const Fields top(scene_.document->root(),
                     {"$schema", "version", "title", "about", "expected", "units", "seed", "gravity", "settings",
                      "time", "materials", "shapes", "bodies", "drives", "probes", "bounds", "passed_below"});
    top.Need("version").Whole(kFormatVersion, kFormatVersion);
    if (const auto field = top.Get("$schema")) field->Text();
    if (const auto field = top.Get("title")) scene_.title = field->Text(200);
    if (const auto field = top.Get("about")) scene_.about = field->Text();
    if (const auto field = top.Get("expected")) scene_.expected = field->Text();
    static constexpr std::array kUnits{"SI"};
    if (const auto field = top.Get("units")) field->Choice(kUnits);
    if (const auto field = top.Get("seed")) scene_.seed = field->Seed();
    if (const auto field = top.Get("gravity")) scene_.settings.gravity = field->Vector();
    if (const auto field = top.Get("settings")) ReadSettings(*field);
    if (const auto field = top.Get("bounds")) scene_.bounds = ReadRegion(*field);
    if (const auto field = top.Get("passed_below")) scene_.passed_z = field->Number(-1e30, 1e30);
    if (const auto field = top.Get("materials")) ReadMaterials(*field);
    if (const auto field = top.Get("shapes")) ReadShapes(*field);
    for (const Field& body : top.Need("bodies").Items(0, kMostEntries)) ReadBody(body);
    if (const auto field = top.Get("drives"))
      for (const Field& drive : field->Items(0, kMostEntries)) ReadDrive(drive);
    if (const auto field = top.Get("probes"))
      for (const Field& probe : field->Items(0, kMostEntries)) ReadProbe(probe);
    scene_.stop_at_rest = scene_.drives.empty();
    if (const auto field = top.Get("time")) ReadTime(*field);
    return std::move(scene_);
  }

 private:
  void ReadTime(const Field& field) {
    const Fields time(field, {"dt", "end", "stop_at_rest"});
    if (const auto dt = time.Get("dt")) scene_.dt = dt->Number(1e-9, 1);
    if (const auto end = time.Get("end")) scene_.end = end->Positive(kLongestRun);
    if (const auto stop = time.Get("stop_at_rest")) scene_.stop_at_rest = stop->Bool();
  }

  void ReadSettings(const Field& field) {
    const Fields given(field, {"model", "cone", "bounce", "bounce_limit", "freeze", "freeze_count", "freeze_seconds",
                               "freeze_travel", "tolerance", "effort", "ladder", "group_bodies", "touch_gap",
                               "overlap_tolerance", "stateless", "cold_volumes"});
    constexpr int kMost = 1'000'000'000;
    Settings& s = scene_.settings;
    if (const auto f = given.Get("model")) s.model = Chosen(*f, kModels);
    if (const auto f = given.Get("cone")) s.cone = Chosen(*f, kCones);
    if (const auto f = given.Get("bounce")) s.bounce_law = Chosen(*f, kBounceLaws);
    if (const auto f = given.Get("bounce_limit")) s.bounce_limit = static_cast<int>(f->Whole(0, kMost));
    if (const auto f = given.Get("freeze")) s.freezing = Chosen(*f, kFreezings);
    if (const auto f = given.Get("freeze_count")) s.freeze_count = static_cast<int>(f->Whole(0, kMost));
    if (const auto f = given.Get("freeze_seconds")) s.freeze_seconds = f->Positive(kLongestRun);
    if (const auto f = given.Get("freeze_travel")) s.freeze_travel = f->Number(1e-12, 0.999);
    if (const auto f = given.Get("tolerance")) s.tolerance = f->Number(1e-15, 0.1);
    if (const auto f = given.Get("effort")) ReadEffort(*f);
    if (const auto f = given.Get("ladder")) ReadLadder(*f);
    if (const auto f = given.Get("group_bodies")) s.group_bodies = static_cast<int>(f->Whole(0, kMost));
    if (const auto f = given.Get("touch_gap")) s.touch_gap = f->Number(1e-9, 0.099);
    if (const auto f = given.Get("overlap_tolerance")) s.overlap_tolerance = f->Number(1e-9, s.touch_gap);
    if (const auto f = given.Get("stateless")) s.stateless = f->Bool();
    if (const auto f = given.Get("cold_volumes"))
      for (const Field& volume : f->Items(0, 10'000)) s.cold_volumes.push_back(ReadRegion(volume));
    try {
      s.Validate();
    } catch (const std::invalid_argument& error) {
      field.Refuse(error.what());
    }
  }

  void ReadEffort(const Field& field) {
    if (field.kind() == JsonKind::kString) {
      scene_.settings.effort = Chosen(field, kEfforts);
    } else {
      scene_.settings.effort.sweeps = static_cast<int>(field.Whole(1, 1'000'000'000));
    }
  }

  void ReadLadder(const Field& field) {
    if (field.kind() != JsonKind::kArray) {
      static constexpr std::array kWhole{"auto", "off"};
      if (field.Choice(kWhole) == 1) scene_.settings.ladder = Ladder::Off();
      return;
    }
    Ladder ladder = Ladder::Off();
    for (const Field& rung : field.Items(0, qp::kNumRungs))
      ladder = ladder.With(static_cast<qp::Rung>(rung.Choice(qp::kRungNames)));
    scene_.settings.ladder = ladder;
  }

  static Coefficients ReadCoefficients(const Field& field) {
    const Fields given(field, {"friction", "restitution"});
    Coefficients material;
    if (const auto f = given.Get("friction")) material.friction = Friction(*f);
    if (const auto f = given.Get("restitution")) material.restitution = Restitution(*f);
    return material;
  }

  void ReadMaterials(const Field& field) {
    const Fields given(field);
    for (const auto& [name, material] : given.members()) materials_.emplace(name, ReadCoefficients(material));
  }

  void ReadShapes(const Field& field) {
    const Fields given(field);
    for (const auto& [name, shape] : given.members()) shapes_.emplace(name, ReadShape(shape));
  }

  // What a user named, of what he defined.
  template <typename T>
  static const T& Look(const Field& field, const std::map<std::string, T>& defined, const char* what) {
    const std::string name = field.Text();
    if (const auto found = defined.find(name); found != defined.end()) return found->second;
    std::vector<const char*> names;
    for (const auto& [known, value] : defined) names.push_back(known.c_str());
    const std::string_view nearest = NearestName(name, names);
    field.Fail(std::string("there is no ") + what + " of that name" +
               (nearest.empty() ? "" : "; did you mean \"" + Shown(nearest) + "\"?"));
  }

  Shape ReadShape(const Field& field) {
    static constexpr std::array kTypes{"sphere", "box", "half_space", "capsule", "cylinder", "convex_hull", "mesh"};
    if (field.kind() != JsonKind::kObject) field.Fail("must be an object with a \"type\"");
    const Field type =
        Fields(field, {"type", "radius", "half_extents", "size", "half_length", "points", "file", "scale"})
            .Need("type");
    switch (type.Choice(kTypes)) {
      case 0:
        return Shape::Sphere(Fields(field, {"type", "radius"}).Need("radius").Positive(kMostLength));
      case 1: {
        const Fields box(field, {"type", "half_extents", "size"});
        const std::string_view key = box.One({"half_extents", "size"});
        return Shape::Box(Sizes(box.Need(key), key == "size" ? 0.5 : 1));
      }
      case 2:
        Fields(field, {"type"});
        return Shape::HalfSpace();
      case 3:
      case 4: {
        const Fields round(field, {"type", "radius", "half_length"});
        const double radius = round.Need("radius").Positive(kMostLength);
        const double half_length = round.Need("half_length").Positive(kMostLength);
        return type.Text() == "capsule" ? Shape::Capsule(radius, half_length) : Shape::Cylinder(radius, half_length);
      }
      case 5: {
        std::vector<Vector3> points;
        const Field given = Fields(field, {"type", "points"}).Need("points");
        for (const Field& point : given.Items(4, kMostHullPoints)) points.push_back(point.Vector());
        return HullOf(given, points);
      }
      default: {
        const Fields mesh(field, {"type", "file", "scale"});
        const Field file = mesh.Need("file");
        const auto scale = mesh.Get("scale");
        return HullOf(file, MeshPoints(file, scale ? scale->Positive(1e6) : 1));
      }
    }
  }

  std::vector<Vector3> MeshPoints(const Field& field, double scale) {
    const std::string name = field.Text(1000);
    if (name.empty() || name[0] == '/' || ("/" + name).find("/../") != std::string::npos)
      field.Fail("must be a path that begins at the folder of the scene file and stays in it");
    try {
      scene_.meshes.push_back(scene_.document->folder() + name);
      std::vector<Vector3> points = ReadMeshPoints(scene_.meshes.back());
      for (Vector3& point : points) point *= scale;
      return points;
    } catch (const std::invalid_argument& error) {
      field.Refuse(error.what());
    }
  }

  Shape HullOf(const Field& field, const std::vector<Vector3>& points) {
    hull_points_ += points.size();
    if (hull_points_ > kMostHullPointsInAll)
      field.Refuse("all hulls together have more than " + std::to_string(kMostHullPointsInAll) + " points");
    for (const Vector3& point : points)
      if (!point.allFinite())
        field.Refuse("a point is not finite");
      else if (point.cwiseAbs().maxCoeff() > kMostLength)
        field.Refuse("a point is more than " + ShortNumber(kMostLength) + " m from the origin");
    try {
      return Shape::ConvexHull(points);
    } catch (const std::invalid_argument& error) {
      field.Fail(error.what());
    }
  }

  void ReadBody(const Field& field) {
    const Fields given(field, {"name",
                               "shape",
                               "kind",
                               "mass",
                               "density",
                               "inertia",
                               "origin",
                               "position",
                               "rotation",
                               "velocity",
                               "angular_velocity",
                               "material",
                               "friction",
                               "restitution",
                               "layers",
                               "collides_with",
                               "sensor",
                               "surface_velocity",
                               "force",
                               "torque",
                               "grid",
                               "stack",
                               "cloud"});
    const Field shape = given.Need("shape");
    BodyEntry entry{
        .place = field,
        .name = {},
        .definition = {.shape = shape.kind() == JsonKind::kString ? Look(shape, shapes_, "shape") : ReadShape(shape)},
        .repetition = {}};
    BodyDefinition& d = entry.definition;
    if (const auto f = given.Get("name")) entry.name = ReadName(*f);
    if (const auto f = given.Get("kind")) d.kind = Chosen(*f, kBodyKinds);
    ReadMass(given, &d);
    if (const auto f = given.Get("rotation")) d.rotation_WB = ReadRotation(*f);
    if (const auto f = given.Get("velocity")) d.linear_velocity_W = Velocity(*f, d.kind);
    if (const auto f = given.Get("angular_velocity")) d.angular_velocity_W = Velocity(*f, d.kind);
    ReadMaterial(given, &d);
    if (const auto f = given.Get("layers")) d.layers = ReadLayers(*f);
    if (const auto f = given.Get("collides_with")) d.collides_with = ReadLayers(*f);
    if (const auto f = given.Get("sensor")) d.sensor = f->Bool();
    if (const auto f = given.Get("surface_velocity")) entry.surface_velocity_B = f->Vector();
    if (const auto f = given.Get("force")) entry.force_W = Force(*f, d.kind);
    if (const auto f = given.Get("torque")) entry.torque_W = Force(*f, d.kind);
    ReadRepetition(given, &entry);
    ReadPosition(given, &entry);
    scene_.bodies.push_back(std::move(entry));
  }

  static std::string ReadName(const Field& field) {
    const std::string name = field.Text(100);
    if (name.empty() || name.find_first_of("[],\"\r\n") != std::string::npos)
      field.Fail("must be a name without brackets, commas, quotes and line breaks");
    return name;
  }

  static Vector3 Velocity(const Field& field, BodyKind kind) {
    if (kind == BodyKind::kFixed) field.Refuse("a fixed body does not move; make it kinematic");
    return field.Vector();
  }

  static Vector3 Force(const Field& field, BodyKind kind) {
    if (kind != BodyKind::kDynamic) field.Refuse("acts on dynamic bodies alone");
    return field.Vector();
  }

  static void ReadMass(const Fields& given, BodyDefinition* d) {
    if (d->shape.kind() == ShapeKind::kHalfSpace && d->kind == BodyKind::kDynamic)
      given.object().Refuse("a half_space has no mass: its \"kind\" must be fixed or kinematic");
    if (d->kind != BodyKind::kDynamic) {
      for (const char* key : {"mass", "density", "inertia"})
        if (const auto f = given.Get(key)) f->Refuse("has a meaning for dynamic bodies alone");
      return;
    }
    if (given.One({"mass", "density"}) == "mass") {
      d->mass = given.Need("mass").Positive();
    } else {
      d->density = given.Need("density").Positive();
    }
    const auto inertia = given.Get("inertia");
    if (inertia) d->inertia_B = ReadInertia(*inertia);
  }

  void ReadMaterial(const Fields& given, BodyDefinition* d) const {
    Coefficients material;
    if (const auto f = given.Get("material"))
      material = f->kind() == JsonKind::kString ? Look(*f, materials_, "material") : ReadCoefficients(*f);
    d->friction = material.friction;
    d->restitution = material.restitution;
    if (const auto f = given.Get("friction")) d->friction = Friction(*f);
    if (const auto f = given.Get("restitution")) d->restitution = Restitution(*f);
  }

  // Of the centre of mass; with "origin": "points" of the origin in which the points of a hull or mesh were given.
  static void ReadPosition(const Fields& given, BodyEntry* entry) {
    const bool cloud = std::holds_alternative<CloudRepetition>(entry->repetition);
    static constexpr std::array kOrigins{"centre_of_mass", "points"};
    const auto origin = given.Get("origin");
    const bool points = origin && origin->Choice(kOrigins) == 1;
    const auto position = given.Get("position");
    if (cloud) {
      for (const char* key : {"position", "rotation", "origin"})
        if (const auto f = given.Get(key)) f->Refuse("a cloud chooses the poses itself");
      return;
    }
    BodyDefinition& d = entry->definition;
    if (position) d.position_W = position->Vector();
    if (!points) return;
    if (d.shape.kind() != ShapeKind::kConvexHull) origin->Refuse("\"points\" is for a convex_hull or a mesh");
    d.position_W += d.rotation_WB.normalized() * d.shape.hull_offset();
  }

  void ReadRepetition(const Fields& given, BodyEntry* entry) {
    const auto grid = given.Get("grid"), stack = given.Get("stack"), cloud = given.Get("cloud");
    if (!grid && !stack && !cloud) return Count(entry->place, 1);
    const std::string_view key = given.One({"grid", "stack", "cloud"});
    const Field field = given.Need(key);
    if (entry->definition.shape.kind() == ShapeKind::kHalfSpace) field.Refuse("a half_space cannot be repeated");
    if (key == "grid") entry->repetition = ReadGrid(field, entry->definition);
    if (key == "stack") entry->repetition = ReadStack(field, entry->definition);
    if (key == "cloud") entry->repetition = ReadCloud(field);
  }

  // Each of these is counted here, so that nothing is made of a number that is too large.
  void Count(const Field& field, std::int64_t more) {
    bodies_ += more;
    if (bodies_ > kMostBodies)
      field.Refuse("makes " + std::to_string(bodies_) + " bodies in all; a scene has at most " +
                   std::to_string(kMostBodies));
  }

  // Two equal bodies that are turned the same way and less than their smallest width apart overlap.
  static void RequireApart(const Field& field, const BodyDefinition& body, double distance) {
    if (Collide(body, body) && distance < 0.999 * body.shape.size())
      field.Refuse("sets bodies " + ShortNumber(distance) + " m apart that are " + ShortNumber(body.shape.size()) +
                   " m thin: they would overlap");
  }

  GridRepetition ReadGrid(const Field& field, const BodyDefinition& body) {
    const Fields given(field, {"counts", "spacing"});
    GridRepetition grid;
    const Field counts = given.Need("counts"), spacing = given.Need("spacing");
    const std::vector<Field> items = counts.Items(3, 3);
    std::int64_t all = 1;
    grid.spacing = spacing.Vector();
    for (int k = 0; k < 3; ++k) {
      grid.counts[k] = static_cast<int>(items[k].Whole(1, kMostBodies));
      all = std::min<std::int64_t>(all * grid.counts[k], std::int64_t{1} << 40);
    }
    Count(counts, all);
    for (int k = 0; k < 3; ++k)
      if (grid.counts[k] > 1) RequireApart(spacing, body, std::abs(grid.spacing[k]));
    return grid;
  }

  StackRepetition ReadStack(const Field& field, const BodyDefinition& body) {
    const Fields given(field, {"count", "step", "turn", "about"});
    StackRepetition stack;
    const Field count = given.Need("count");
    stack.count = static_cast<int>(count.Whole(1, kMostBodies));
    Count(count, stack.count);
    if (const auto turn = given.Get("turn")) stack.turn = ReadRotation(*turn).normalized();
    const auto about = given.Get("about");
    if (about) stack.about = about->Vector();
    const auto step = about ? given.Get("step") : given.Need("step");
    if (step) stack.step = step->Vector();
    const bool alike =
        body.shape.kind() != ShapeKind::kConvexHull || !given.Get("turn");  // a hull may be thin on one side
    if (stack.count > 1 && !about && alike) RequireApart(*step, body, stack.step.norm());
    return stack;
  }

  CloudRepetition ReadCloud(const Field& field) {
    const Fields given(field, {"count", "box", "ball", "turn", "seed"});
    CloudRepetition cloud;
    const Field count = given.Need("count");
    cloud.count = static_cast<int>(count.Whole(1, kMostBodies));
    Count(count, cloud.count);
    if (const auto turn = given.Get("turn")) cloud.turn = turn->Bool();
    if (const auto seed = given.Get("seed")) cloud.seed = seed->Seed();
    if (given.One({"box", "ball"}) == "box") {
      cloud.box = ReadRegion(given.Need("box"));
    } else {
      const Fields ball(given.Need("ball"), {"centre", "radius"});
      cloud.centre = ball.Need("centre").Vector();
      cloud.radius = ball.Need("radius").Positive(kMostLength);
    }
    return cloud;
  }

  // "ball", "ball[3]" or 7.
  static BodyChoice ReadChoice(const Field& field) {
    BodyChoice choice{field, {}, -1};
    if (field.kind() == JsonKind::kNumber) {
      choice.number = static_cast<int>(field.Whole(0, kMostBodies - 1));
      return choice;
    }
    if (field.kind() != JsonKind::kString) field.Fail("must be the name of a body or its number");
    choice.name = field.Text(200);
    const size_t bracket = choice.name.find('[');
    if (bracket != std::string::npos) {
      const std::string digits = choice.name.substr(bracket + 1);
      const bool good = digits.size() >= 2 && digits.size() <= 8 && digits.back() == ']' &&
                        digits.find_first_not_of("0123456789") == digits.size() - 1;
      if (!good) field.Fail("must be a name, or a name and a number: \"brick[3]\"");
      choice.number = std::stoi(digits);
      choice.name.resize(bracket);
    }
    if (choice.name.empty()) field.Fail("must be the name of a body or its number");
    return choice;
  }

  void ReadDrive(const Field& field) {
    const Fields given(field, {"body", "force", "torque", "velocity", "angular_velocity", "shift", "turn", "gravity"});
    DriveEntry entry{.place = field, .bodies = {}, .what = {}};
    if (const auto gravity = given.Get("gravity")) {
      const Fields alone(field, {"gravity"});
      entry.what = GravityDrive{ReadFunctions(*gravity)};
      scene_.drives.push_back(std::move(entry));
      return;
    }
    entry.bodies = ReadChoice(given.Need("body"));
    const auto read = [&](const char* key) {
      const auto functions = given.Get(key);
      return functions ? ReadFunctions(*functions) : TimeVector{};
    };
    if (given.Get("force") || given.Get("torque")) {
      const Fields alone(field, {"body", "force", "torque"});
      entry.what = ForceDrive{read("force"), read("torque")};
    } else if (given.Get("velocity") || given.Get("angular_velocity")) {
      const Fields alone(field, {"body", "velocity", "angular_velocity"});
      const auto if_given = [&](const char* key) { return given.Get(key) ? std::optional(read(key)) : std::nullopt; };
      entry.what = VelocityDrive{if_given("velocity"), if_given("angular_velocity")};
    } else if (given.Get("shift") || given.Get("turn")) {
      const Fields alone(field, {"body", "shift", "turn"});
      PoseDrive pose;
      pose.shift_W = read("shift");
      if (const auto turn = given.Get("turn")) ReadTurn(*turn, &pose);
      entry.what = std::move(pose);
    } else {
      field.Refuse("needs force, torque, velocity, angular_velocity, shift, turn or gravity");
    }
    scene_.drives.push_back(std::move(entry));
  }

  static void ReadTurn(const Field& field, PoseDrive* pose) {
    const Fields turn(field, {"axis", "centre", "angle"});
    pose->axis_W = turn.Need("axis").UnitVector();
    if (const auto centre = turn.Get("centre")) pose->centre = centre->Vector();
    pose->angle = ReadFunction(turn.Need("angle"));
  }

  void ReadProbe(const Field& field) {
    const Fields given(field, {"body", "write"});
    ProbeEntry probe{ReadChoice(given.Need("body")), {}};
    for (const Field& what : given.Need("write").Items(1, std::size(kProbeNames)))
      probe.write.push_back(static_cast<ProbeWhat>(what.Choice(kProbeNames)));
    scene_.probes.push_back(std::move(probe));
  }

  SceneDescription scene_;
  std::map<std::string, Coefficients> materials_;
  std::map<std::string, Shape> shapes_;
  size_t hull_points_ = 0;
  std::int64_t bodies_ = 0;
};

}  // namespace

SceneDescription ReadScene(std::shared_ptr<const Document> document) { return SceneReader(std::move(document)).Read(); }

}  // namespace islet
