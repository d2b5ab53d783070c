// The manifold of two faces that meet: the incident face is cut to the outline of the reference face, and each corner
// of what remains becomes a contact with a gap of its own.
//
//         incident face of the other body
//      *-----------------*
//       \ . . . . . . . /          kept corners: gap = height over the reference plane, up to the reach
//   -----+-------------+-----      reference face, its side planes upright
//
//   threads: one FaceClip per thread (scratch memory)      allocation: none once the scratch has grown
#pragma once

#include <vector>

#include "engine/contact.h"

namespace islet {

// The two bodies seen from any common origin; keep it near the bodies, for round-off.
struct ClipInput {
  Vector3 origin_W;                    // [m] added to the points at the end
  const Vector3* reference = nullptr;  // [m] corners, counter-clockwise seen from outside, relative to origin
  int num_reference = 0;
  Vector3 normal;  // unit, outward of the reference face, W
  const Vector3* incident = nullptr;
  int num_incident = 0;
  bool reference_is_b = false;
  int reference_face = 0;  // numbers that go into Contact::feature
  int incident_face = 0;
  double size = 0;   // [m] smallest extent of the pair
  double reach = 0;  // [m]
};

class FaceClip {
 public:
  // Appends what lies over the reference face, with normals from a into b: nothing if the faces pass each other by.
  // Returns the least gap it appended, infinity if none.
  double Append(const ClipInput& input, std::vector<Contact>* contacts);

  // Appends of the corners of the incident face up to `highest` over the reference plane those that are nearest to the reference face along it.
  void AppendNearestCorners(const ClipInput& input, double highest, std::vector<Contact>* contacts) const;

  // Appends the corners of the incident face up to `highest` over the reference plane that lie beside the reference face, but
  // not farther from it than `beside` [m]. Returns whether there was one.
  bool AppendCornersBeside(const ClipInput& input, double highest, double beside, std::vector<Contact>* contacts) const;

 private:
  // [m] how far beyond the sides of the reference face a point is, along it; 0: over the face.
  static double Outside(const ClipInput& input, const Vector3& point);

  struct Corner {
    Vector3 point;
    // The sides of the polygon that meet here: side planes first, then edges of the incident face.
    int edge_in, edge_out;
  };
  void Cut(const Vector3& on_plane, const Vector3& outward, double slack, int side);
  void Emit(const ClipInput& input, const Corner& corner, double gap, std::vector<Contact>* contacts) const;

  std::vector<Corner> polygon_, scratch_;
  std::vector<double> heights_;
};

}  // namespace islet
