//! The room, and the camera with its light: rendered by the example, and path-traced by a test of it.

use bevy::prelude::*;
use frugal_trace::integrator::View;
use frugal_trace::scene::CameraPose;

const WALL: Color = Color::linear_rgb(0.7, 0.7, 0.7);
const WOOD: Color = Color::linear_rgb(0.5, 0.35, 0.2);

/// Size, centre and colour of each box: the corner of a room, and what stands in it. The rest of the
/// room would be out of view, and most of its light would turn more than once, which is not simulated.
pub(crate) const BLOCKS: [(Vec3, Vec3, Color); 5] = [
    (vec3(4.2, 0.1, 4.2), vec3(0.0, -0.05, 0.0), WALL),
    (vec3(4.2, 4.0, 0.1), vec3(0.0, 2.0, -2.05), WALL),
    (vec3(0.1, 4.0, 4.2), vec3(-2.05, 2.0, 0.0), WALL),
    (vec3(0.6, 1.3, 0.6), vec3(-0.3, 0.65, -1.4), WOOD),
    (vec3(0.7, 0.5, 0.7), vec3(-1.0, 0.25, 0.2), WALL),
];

/// The camera and its light, metres; and a point that it looks at.
const EYE: Vec3 = vec3(1.5, 1.4, 1.7);
const TARGET: Vec3 = vec3(-1.2, 1.0, -1.2);
const FIELD_OF_VIEW_DEGREES: f32 = 60.0;
const NEAR: f32 = 0.01;

/// Luminous intensity of the light in all of the image, candela.
pub(crate) const CANDELA: f32 = 500.0;
/// Range of the light, metres: so long that Bevy's window on a light's range takes nothing.
pub(crate) const RANGE: f32 = 1e3;
/// Half angles of its cone, degrees: all of an image of 16 to 9 lies in the inner one.
pub(crate) const CONE_DEGREES: [f32; 2] = [51.0, 60.0];

/// The camera's view, of an image of `size` pixels.
pub(crate) fn view(size: UVec2) -> View {
    let pose = CameraPose::looking_at(EYE, TARGET);
    View { pose, vertical_fov_degrees: FIELD_OF_VIEW_DEGREES, near: NEAR, size }
}
