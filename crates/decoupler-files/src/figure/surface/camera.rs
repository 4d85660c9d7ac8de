//! A camera that circles the plot.

use glam::Vec3;
use serde::{Deserialize, Serialize};

const RADIANS_PER_POINT: f32 = 0.008;
const RADIANS_PER_KEY: f32 = 0.1;
const ZOOM_PER_POINT: f32 = 0.0025;
const ZOOM_PER_KEY: f32 = 1.15;
/// Always from above: the floor of the box is never in front of the surface.
const PITCH: std::ops::RangeInclusive<f32> = 0.09..=1.5;
const ZOOM: std::ops::RangeInclusive<f32> = 0.5..=8.0;
const PAN: std::ops::RangeInclusive<f32> = -2.0..=2.0;

/// Camera that orbits the plot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OrbitCamera {
    /// Direction of the eye in the x-y plane, radians from the x axis.
    pub yaw: f32,
    /// Elevation of the eye, radians.
    pub pitch: f32,
    /// 1 makes the plot fill its card.
    pub zoom: f32,
    /// Shift to the right and down, in card widths and heights.
    pub pan: [f32; 2],
}

impl Default for OrbitCamera {
    fn default() -> Self {
        Self {
            yaw: -0.9,
            pitch: 0.5,
            zoom: 1.0,
            pan: [0.0; 2],
        }
    }
}

impl OrbitCamera {
    /// Unit vector from the middle of the plot towards the eye; z points up.
    pub fn towards_eye(&self) -> Vec3 {
        Vec3::new(
            self.pitch.cos() * self.yaw.cos(),
            self.pitch.cos() * self.yaw.sin(),
            self.pitch.sin(),
        )
    }

    /// Turned as if the plot were dragged by this many points to the right and down.
    #[must_use]
    pub fn dragged(self, right: f32, down: f32) -> Self {
        self.turned(right * RADIANS_PER_POINT, down * RADIANS_PER_POINT)
    }

    /// Turned by this many presses of an arrow key.
    #[must_use]
    pub fn stepped(self, right: f32, down: f32) -> Self {
        self.turned(right * RADIANS_PER_KEY, down * RADIANS_PER_KEY)
    }

    fn turned(self, right: f32, down: f32) -> Self {
        Self {
            yaw: self.yaw - right,
            pitch: self.pitch + down,
            ..self
        }
        .clamped()
    }

    /// Nearer by this many points of scrolling.
    #[must_use]
    pub fn scrolled(self, points: f32) -> Self {
        self.zoomed((points * ZOOM_PER_POINT).exp())
    }

    /// Nearer by this many presses of a key.
    #[must_use]
    pub fn zoomed_by_keys(self, presses: f32) -> Self {
        self.zoomed(ZOOM_PER_KEY.powf(presses))
    }

    /// Nearer by a factor.
    #[must_use]
    pub fn zoomed(self, factor: f32) -> Self {
        Self {
            zoom: self.zoom * factor,
            ..self
        }
        .clamped()
    }

    /// Shifted by a part of the card to the right and down.
    #[must_use]
    pub fn panned(self, right: f32, down: f32) -> Self {
        Self {
            pan: [self.pan[0] + right, self.pan[1] + down],
            ..self
        }
        .clamped()
    }

    /// As seen at zoom 1, in the middle of the card.
    #[must_use]
    pub fn centred(self) -> Self {
        Self {
            zoom: 1.0,
            pan: [0.0; 2],
            ..self
        }
    }

    /// Within the limits, whatever a saved state says.
    #[must_use]
    pub fn clamped(self) -> Self {
        let start = Self::default();
        let finite = |value: f32, otherwise: f32| if value.is_finite() { value } else { otherwise };
        let (turn, yaw) = (std::f32::consts::TAU, finite(self.yaw, start.yaw));
        // A camera within the limits keeps its bits: being looked at is no change.
        let is_wound = yaw.abs() > 0.5 * turn;
        Self {
            yaw: if is_wound {
                (yaw + 0.5 * turn).rem_euclid(turn) - 0.5 * turn
            } else {
                yaw
            },
            pitch: finite(self.pitch, start.pitch).clamp(*PITCH.start(), *PITCH.end()),
            zoom: finite(self.zoom, start.zoom).clamp(*ZOOM.start(), *ZOOM.end()),
            pan: self.pan.map(|part| finite(part, 0.0).clamp(*PAN.start(), *PAN.end())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dragging_there_and_back_changes_nothing() {
        let camera = OrbitCamera::default();
        let back = camera.dragged(40.0, -10.0).dragged(-40.0, 10.0);
        assert!((back.yaw - camera.yaw).abs() < 1e-5 && (back.pitch - camera.pitch).abs() < 1e-5);
    }

    #[test]
    fn the_eye_stays_above_the_floor() {
        for down in [-1e6, 1e6] {
            let eye = OrbitCamera::default().dragged(0.0, down).towards_eye();
            assert!(eye.z > 0.05 && eye.z < 0.999);
        }
    }

    #[test]
    fn a_broken_saved_camera_is_repaired() {
        let camera = OrbitCamera {
            yaw: f32::NAN,
            pitch: f32::INFINITY,
            zoom: -1.0,
            pan: [f32::NAN, 9.0],
        }
        .clamped();
        assert_eq!(
            camera,
            OrbitCamera {
                zoom: 0.5,
                pan: [0.0, 2.0],
                ..OrbitCamera::default()
            }
        );
    }

    #[test]
    fn the_camera_survives_saving() {
        let camera = OrbitCamera::default().dragged(12.0, 3.0).panned(0.1, 0.0);
        let text = serde_json::to_string(&camera).expect("plain numbers");
        assert_eq!(
            serde_json::from_str::<OrbitCamera>(&text).expect("written by us"),
            camera
        );
        assert_eq!(
            serde_json::from_str::<OrbitCamera>("{}").expect("all fields have defaults"),
            OrbitCamera::default()
        );
    }
}
