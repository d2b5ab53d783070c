#include "engine/body.h"

namespace islet {

Matrix3 Body::InertiaW() const {
  const Matrix3 rotation = rotation_WB.toRotationMatrix();
  return rotation * inertia_B * rotation.transpose();
}

Matrix3 Body::InverseInertiaW() const {
  const Matrix3 rotation = rotation_WB.toRotationMatrix();
  const Matrix3 inverse_B = inertia_B.inverse();
  return rotation * inverse_B * rotation.transpose();
}

double Body::KineticEnergy() const {
  return 0.5 * mass * linear_velocity_W.squaredNorm() + 0.5 * angular_velocity_W.dot(AngularMomentumW());
}

Vector3 Body::AngularMomentumW() const {
  const Matrix3 rotation = rotation_WB.toRotationMatrix();
  const Vector3 angular_velocity_B = rotation.transpose() * angular_velocity_W;
  const Vector3 momentum_B = inertia_B * angular_velocity_B;
  return rotation * momentum_B;
}

Vector3 Body::VelocityAt(const Vector3& point_W) const {
  return linear_velocity_W + angular_velocity_W.cross(point_W - position_W);
}

void Body::ApplyImpulse(const Vector3& impulse_W, const Vector3& point_W) {
  linear_velocity_W += impulse_W / mass;
  angular_velocity_W += InverseInertiaW() * (point_W - position_W).cross(impulse_W);
}

}  // namespace islet
