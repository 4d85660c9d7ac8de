use std::sync::Arc;

use glam::DVec3;
use thiserror::Error;

use crate::window::test_view::Frame;
use decoupler_core::{
    dataset::Simulation,
    identifiability::Identifiability,
    scene::{RowModel, Scene, SceneError},
    sensor::{RelativeNoise, SensorError, SensorModel},
    surface::{SurfaceError, SurfaceMap},
};

/// Question to be analysed: a sensor, its scene, and the compression of its nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Question {
    /// The sensor.
    pub sensor: SensorModel,
    /// The rows that are read, the movement, and the noise of the readings.
    pub scene: Scene,
    /// Uniform compression at which the Jacobian is evaluated, as a fraction of the height.
    pub compression: f64,
}

impl Question {
    /// Returns the question for the sensor and the scene of a simulation, at half the scene's largest compression.
    pub fn of(simulation: &Simulation) -> Self {
        Self {
            sensor: simulation.sensor,
            scene: simulation.scene,
            compression: 0.5 * simulation.scene.largest_compression,
        }
    }
}

/// Identifiability of an array: what its readings determine.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// Question that was analysed.
    pub question: Question,
    /// Each row-wire that is read.
    pub rows: Vec<Identifiability>,
    /// Index in [`Self::rows`] of the row with the smallest singular value.
    pub worst: usize,
    /// Relative error of a reading (one standard deviation), from all sources of the scene.
    pub noise: RelativeNoise,
    /// Prior standard deviation of each unknown: that of a uniform distribution over the stroke.
    pub prior_mm: f64,
    /// The most similar rows and the difference of their readings, if a decoder must distinguish them.
    pub alike: Option<([usize; 2], f64)>,
    /// Warnings, worst first.
    pub warnings: Vec<String>,
    /// The surface through the nodes.
    pub surface: Arc<SurfaceMap>,
    /// For each moving axis, the worst-seen pattern of every row, scaled to a largest deflection of 1.
    pub patterns: Vec<Frame>,
    /// For each moving axis, the sensitivity of every node in 1/mm.
    pub sensitivities: Vec<Frame>,
}

/// Error of an analysis.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// An invalid scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An invalid sensor.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// No surface can be fitted through the nodes.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

impl Analysis {
    /// Analyses every row that is read; returns `None` once it `is_abandoned`.
    ///
    /// # Errors
    /// If the sensor or the scene is invalid.
    pub fn new(question: &Question, is_abandoned: impl Fn() -> bool) -> Result<Option<Self>, AnalysisError> {
        let Question { sensor, scene, .. } = question;
        sensor.check()?;
        scene.check()?;
        let read = scene.rows.read(sensor.scale.rows())?;
        let depth_mm = question.compression * sensor.geometry.height_mm;
        let displacements_mm = vec![DVec3::Z * depth_mm; sensor.scale.nodes_per_row()];
        let axes = scene.movement.axes();
        let mut rows = Vec::with_capacity(read.len());
        for row in read {
            if is_abandoned() {
                return Ok(None);
            }
            rows.push(Identifiability::of_row(
                sensor,
                row,
                &displacements_mm,
                axes,
                RelativeNoise::default(),
            )?);
        }
        align(&mut rows);
        let smallest = |seen: &Identifiability| seen.singular_values_per_mm.last().copied().unwrap_or(0.0);
        let worst = (0..rows.len()).min_by(|&a, &b| smallest(&rows[a]).total_cmp(&smallest(&rows[b])));
        let worst = worst.unwrap_or(0);
        let noise = RelativeNoise::of(scene.noise, sensor, &[rows[worst].row], depth_mm)?;
        if noise.common > 0.0 {
            for seen in &mut rows {
                *seen = Identifiability::of_row(sensor, seen.row, &displacements_mm, axes, noise)?;
            }
            align(&mut rows);
        }
        let alike = match scene.rows.model() {
            RowModel::Shared => Some(Identifiability::most_alike_rows(sensor, noise)?),
            RowModel::Each => None,
        };
        let prior_mm = scene.stroke_mm(&sensor.geometry) / 12.0_f64.sqrt();
        let read = Vec::from_iter(rows.iter().map(|seen| seen.row));
        let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &read);
        let surface = SurfaceMap::shared(&x_mm, &y_mm)?;
        let alike = alike.flatten();
        let frames = |value: fn(&Identifiability, usize) -> DVec3, scale: f64| -> Vec<Frame> {
            let of_axis = |&axis: &usize| frame(sensor, &rows, &surface, |seen, node| scale * value(seen, node)[axis]);
            axes.indices().iter().map(of_axis).collect()
        };
        let deflections = rows.iter().flat_map(|seen| &seen.worst_pattern);
        let largest = deflections.map(|u| u.abs().max_element()).fold(0.0, f64::max);
        Ok(Some(Self {
            question: *question,
            worst,
            noise,
            prior_mm,
            alike,
            warnings: rows[worst].warnings(noise.own, prior_mm, alike),
            patterns: frames(|seen, node| seen.worst_pattern[node], largest.recip()),
            sensitivities: frames(|seen, node| seen.sensitivity_per_mm[node], 1.0),
            surface,
            rows,
        }))
    }

    /// Returns the row with the smallest singular value.
    pub fn worst_row(&self) -> &Identifiability {
        &self.rows[self.worst]
    }

    /// Returns the singular value at which the uncertainty due to noise equals the prior standard deviation. Patterns
    /// below it are hidden by the noise.
    pub fn hidden_below_per_mm(&self) -> f64 {
        self.noise.own / self.prior_mm
    }

    /// Returns the number of deformation patterns of the worst row above the noise.
    pub fn patterns_seen(&self) -> usize {
        let values = self.worst_row().singular_values_per_mm.iter();
        values.filter(|&&value| value > self.hidden_below_per_mm()).count()
    }
}

/// Flips patterns to match the sign of their neighbours. The sign of a singular vector is arbitrary, and a surface
/// through the patterns should show their shape.
fn align(rows: &mut [Identifiability]) {
    for row in 1..rows.len() {
        let (before, after) = rows.split_at_mut(row);
        let (before, after) = (&before[row - 1].worst_pattern, &mut after[0].worst_pattern);
        let along: f64 = before.iter().zip(after.iter()).map(|(a, b)| a.dot(*b)).sum();
        if along < 0.0 {
            after.iter_mut().for_each(|u| *u = -*u);
        }
    }
}

fn frame(
    sensor: &SensorModel,
    rows: &[Identifiability],
    surface: &SurfaceMap,
    value: impl Fn(&Identifiability, usize) -> f64,
) -> Frame {
    let nodes = 0..sensor.scale.nodes_per_row();
    let nodes_mm = rows.iter().flat_map(|seen| {
        let at = |node| sensor.geometry.row_node_mm(sensor.scale, seen.row, node);
        nodes.clone().map(move |node| (seen, node, at(node)))
    });
    let nodes_mm: Vec<DVec3> = nodes_mm.map(|(seen, node, at)| at.with_z(value(seen, node))).collect();
    let values: Vec<f64> = nodes_mm.iter().map(|node| node.z).collect();
    Frame {
        grid_mm: surface.evaluate(&values).into(),
        nodes_mm: nodes_mm.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::scene::{Movement, Noise, Rows};

    fn analysis(question: &Question) -> Analysis {
        Analysis::new(question, || false).unwrap().unwrap()
    }

    #[test]
    fn the_worst_row_has_the_smallest_singular_value_and_each_node_has_its_value() {
        let question = Question::of(&Simulation::default());
        let found = analysis(&question);
        assert_eq!((found.rows.len(), found.patterns.len()), (10, 1));
        for row in 0..10 {
            let pressed = vec![DVec3::Z * 0.5; 10];
            let (axes, noise) = (found.rows[row].axes, RelativeNoise::default());
            let alone = Identifiability::of_row(&question.sensor, row, &pressed, axes, noise).unwrap();
            assert_eq!(alone.singular_values_per_mm, found.rows[row].singular_values_per_mm);
            let (smallest, worst) = (
                alone.singular_values_per_mm[9],
                found.worst_row().singular_values_per_mm[9],
            );
            assert!(worst <= smallest);
            let shown = &found.sensitivities[0].nodes_mm[10 * row..10 * row + 10];
            assert!(shown.iter().zip(&alone.sensitivity_per_mm).all(|(a, b)| a.z == b.z));
        }
        let largest = found.patterns[0]
            .nodes_mm
            .iter()
            .map(|node| node.z.abs())
            .fold(0.0, f64::max);
        assert!((largest - 1.0).abs() < 1e-12);
        assert_eq!(found.noise.total(), 0.0);
        assert_eq!(found.patterns_seen(), 10);
    }

    #[test]
    fn neighbouring_patterns_have_the_same_sign() {
        let found = analysis(&Question::of(&Simulation::default()));
        let nodes = &found.patterns[0].nodes_mm;
        for row in 1..10 {
            let along: f64 = (0..10)
                .map(|node| nodes[10 * row + node].z * nodes[10 * row - 10 + node].z)
                .sum();
            assert!(along >= 0.0, "row {row}");
        }
    }

    #[test]
    fn every_source_of_noise_counts() {
        let mut question = Question::of(&Simulation::default());
        question.scene.noise = Noise {
            relative: 3e-3,
            drift: 4e-3,
            ..Noise::default()
        };
        assert!((analysis(&question).noise.total() - 5e-3).abs() < 1e-15);
        question.scene.noise = Noise {
            converter_bits: Some(8),
            ..Noise::default()
        };
        assert!(analysis(&question).noise.total() > 1e-4);
    }

    #[test]
    fn a_mirrored_layout_gives_a_warning_unless_the_row_is_known() {
        let mut question = Question::of(&Simulation::default());
        question.sensor = SensorModel::new("10x6_3x18".parse().unwrap());
        // Column nodes at 7.5, 12.5 and 17.5 mirror the rows about x = 12.5.
        question.sensor.geometry.column_node_x0_mm = 7.5;
        let is_alike = |found: &Analysis| {
            let warnings = found.warnings.iter();
            warnings.clone().any(|warning| warning.contains("cannot be told apart"))
        };
        assert!(is_alike(&analysis(&question)));
        question.scene.rows = Rows::Known;
        assert!(!is_alike(&analysis(&question)));
    }

    #[test]
    fn each_moving_axis_has_its_pictures_and_invalid_questions_give_a_reason() {
        let mut question = Question::of(&Simulation::default());
        question.scene.movement = Movement::SIDEWAYS;
        let found = analysis(&question);
        assert_eq!((found.patterns.len(), found.sensitivities.len()), (3, 3));
        assert!(Analysis::new(&question, || true).unwrap().is_none());
        question.sensor.geometry.height_mm = -1.0;
        let message = Analysis::new(&question, || false).unwrap_err().to_string();
        assert!(message.contains("height"), "{message}");
    }
}
