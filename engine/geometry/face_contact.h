// From the axis of a face to contacts: the last step that boxes and hulls share.
//
// Usually that is the clipped manifold. While the bodies are apart it can miss the corner that is nearest to the
// reference plane, when that corner lies beside the reference face. Then the nearest points of the two bodies make the
// one contact.
//   threads: pure; scratch memory is one per thread
#pragma once

#include <vector>

#include "engine/geometry/face_clip.h"
#include "engine/geometry/narrow_phase.h"

namespace islet {

// separation: [m] of the face's axis normal_W, a unit vector from a to b.
void AppendFaceContacts(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                        double separation, const Vector3& normal_W, const ClipInput& input,
                        std::vector<Contact>* contacts);

// The nearest points as the one contact, if within reach. For bodies that every face's axis says overlap and only a pair of
// edges keeps apart (the axis normal_W, separation > 0), where those edges pass each other by: the nearest points are then a
// corner's or another pair's, and a face would report an overlap that is not there.
void AppendNearestPoints(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                         const Vector3& normal_W, double separation, double reach, std::vector<Contact>* contacts);

// Do only edges keep the bodies apart?
inline bool OnlyEdgesSeparate(double face_separation, double edge_separation) {
  return face_separation <= 0 && edge_separation > 0;
}

}  // namespace islet
