//! What the user presses: the imprint of an indenter, and nodes moved one by one.

use std::collections::BTreeMap;

use decoupler_core::{
    scene::{Deformation, Indenter},
    sensor::SensorModel,
};
use glam::{DVec2, DVec3};

/// A manually defined deformation: the imprint of an indenter, and individual nodes moved up or down.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Touch {
    /// The indenter pressed onto the surface, if there is one.
    pub print: Option<Print>,
    /// Depths in millimetres of individually moved nodes, by row-wire and node on it, from 0; they override the imprint.
    pub nodes_mm: BTreeMap<(usize, usize), f64>,
}

/// An upright indenter pressed at one position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Print {
    /// The indenter; the middle of its range of sizes is used.
    pub indenter: Indenter,
    /// Position of its centre.
    pub place_mm: DVec2,
    /// Depth at its centre.
    pub depth_mm: f64,
}

impl Touch {
    /// Returns the deformation of an array, with depths limited to between 0 and `stroke_mm`.
    pub fn deformation(&self, model: &SensorModel, stroke_mm: f64) -> Deformation {
        let within = |depth_mm: f64| depth_mm.clamp(0.0, stroke_mm);
        let print = self.print.as_ref().map(|print| {
            let depth_mm = within(print.depth_mm);
            print.indenter.press(model, print.place_mm, depth_mm)
        });
        Deformation::from_fn(model.scale, |row, node| {
            let of_print = print.as_ref().map_or(DVec3::ZERO, |print| print.row_mm(row)[node]);
            let moved_mm = self.nodes_mm.get(&(row, node));
            moved_mm.map_or(of_print, |&depth_mm| DVec3::Z * within(depth_mm))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> SensorModel {
        SensorModel::new("10x6_3x18".parse().unwrap())
    }

    #[test]
    fn a_punch_presses_the_nodes_under_its_face_and_leaves_those_far_away() {
        let model = model();
        let middle = model.geometry.row_node_mm(model.scale, 4, 2);
        let indenter = Indenter::all()[1];
        let touch = Touch {
            print: Some(Print {
                indenter,
                place_mm: middle.truncate(),
                depth_mm: 0.6,
            }),
            ..Touch::default()
        };
        let pressed = touch.deformation(&model, 1.0);
        assert_eq!(pressed.row_mm(4)[2], DVec3::new(0.0, 0.0, 0.6));
        // The face of middle size, 4 mm in radius, covers the neighbours 2 mm away.
        assert_eq!(pressed.row_mm(4)[3].z, 0.6);
        assert!(pressed.row_mm(9)[5].z < 0.6 * 0.5);
    }

    #[test]
    fn depths_stay_within_the_limits_of_the_scene() {
        let model = model();
        let deep = |depth_mm| Touch {
            print: Some(Print {
                indenter: Indenter::default(),
                place_mm: DVec2::new(12.0, 9.0),
                depth_mm,
            }),
            nodes_mm: [((0, 0), 7.0), ((1, 1), -7.0), ((2, 2), 0.25)].into(),
        };
        for depth_mm in [-3.0, 0.0, 0.4, 99.0] {
            let pressed = deep(depth_mm).deformation(&model, 0.5);
            for row in 0..10 {
                assert!(pressed.row_mm(row).iter().all(|u| (0.0..=0.5).contains(&u.z)));
            }
            let [low, high, free] = [(0, 0), (1, 1), (2, 2)].map(|(row, node)| pressed.row_mm(row)[node].z);
            assert_eq!(
                [low, high, free],
                [0.5, 0.0, 0.25],
                "moved nodes stay where they were put"
            );
        }
        assert!(
            Touch::default()
                .deformation(&model, 1.0)
                .row_mm(3)
                .iter()
                .all(|u| *u == DVec3::ZERO)
        );
    }
}
