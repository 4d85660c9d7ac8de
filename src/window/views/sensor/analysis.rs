use std::{error::Error, sync::Arc};

use decoupler_core::{
    identifiability::Identifiability,
    scene::{RowModel, Scene},
    sensor::{RelativeNoise, SensorModel},
    surface::SurfaceMap,
};
use decoupler_files::figure::{
    SequentialMap,
    surface::{Quantity, Surface, ViewMode},
};
use glam::DVec3;

/// What the readings of an array determine.
#[derive(Clone, Debug)]
pub(super) struct Analysis {
    /// The sensor.
    pub sensor: SensorModel,
    /// Each row-wire that is read, with its nodes pressed by half the stroke.
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
    /// For each moving axis, the worst-seen pattern of every row, scaled to a largest deflection of 1, and the sensitivity of
    /// every node in 1/mm.
    pub surfaces: Vec<[Surface; 2]>,
}

impl Analysis {
    /// Analyses every row that is read; returns `None` once it `is_abandoned`.
    ///
    /// # Errors
    /// If the sensor or the scene is invalid, or no surface can be fitted through the nodes.
    pub fn new(
        sensor: &SensorModel,
        scene: &Scene,
        is_abandoned: impl Fn() -> bool,
    ) -> Result<Option<Self>, Box<dyn Error>> {
        sensor.check()?;
        scene.check()?;
        let depth_mm = 0.5 * scene.stroke_mm(&sensor.geometry);
        let displacements_mm = vec![DVec3::Z * depth_mm; sensor.scale.nodes_per_row()];
        let of_row = |row: usize, noise: RelativeNoise| {
            Identifiability::of_row(sensor, row, &displacements_mm, scene.movement.axes(), noise)
        };
        let mut rows = Vec::new();
        for row in scene.rows.read(sensor.scale.rows())? {
            if is_abandoned() {
                return Ok(None);
            }
            rows.push(of_row(row, RelativeNoise::default())?);
        }
        let smallest = |seen: &Identifiability| seen.singular_values_per_mm.last().copied().unwrap_or(0.0);
        let worst = (0..rows.len()).min_by(|&a, &b| smallest(&rows[a]).total_cmp(&smallest(&rows[b])));
        let worst = worst.unwrap_or(0);
        let noise = RelativeNoise::of(scene.noise, sensor, &[rows[worst].row], depth_mm)?;
        if noise.common > 0.0 {
            for seen in &mut rows {
                *seen = of_row(seen.row, noise)?;
            }
        }
        align(&mut rows);
        let alike = match scene.rows.model() {
            RowModel::Shared => Identifiability::most_alike_rows(sensor, noise)?,
            RowModel::Each => None,
        };
        let prior_mm = scene.stroke_mm(&sensor.geometry) / 12.0_f64.sqrt();
        Ok(Some(Self {
            sensor: *sensor,
            worst,
            noise,
            prior_mm,
            alike,
            warnings: rows[worst].warnings(noise.own, prior_mm, alike),
            surfaces: surfaces(sensor, scene, &rows)?,
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

fn surfaces(
    sensor: &SensorModel,
    scene: &Scene,
    rows: &[Identifiability],
) -> Result<Vec<[Surface; 2]>, Box<dyn Error>> {
    let read = Vec::from_iter(rows.iter().map(|seen| seen.row));
    let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &read);
    let map = SurfaceMap::shared(&x_mm, &y_mm)?;
    let per_row = sensor.scale.nodes_per_row();
    let nodes_mm = |row: usize| (0..per_row).map(move |node| sensor.geometry.row_node_mm(sensor.scale, row, node));
    let surface = |axis: usize, quantity: Quantity| {
        let of_row: fn(&Identifiability) -> &[DVec3] = match quantity {
            Quantity::Pattern => |seen| &seen.worst_pattern,
            _ => |seen| &seen.sensitivity_per_mm,
        };
        let values = rows.iter().flat_map(of_row);
        let largest = values.clone().map(|value| value.abs().max_element());
        let largest = largest
            .filter(|value| value.is_finite())
            .fold(f64::MIN_POSITIVE, f64::max);
        let (title, scale, range) = match quantity {
            Quantity::Pattern => ("Worst-seen deformation", largest, -1.0..=1.0),
            _ => ("Sensitivity of each node", 1.0, 0.0..=largest),
        };
        let values = Vec::from_iter(values.map(|value| value[axis] / scale));
        let nodes = read.iter().flat_map(|&row| nodes_mm(row)).zip(&values);
        Surface {
            title: title.to_owned(),
            map: Arc::clone(&map),
            values: map.evaluate(&values).into(),
            nodes: nodes.map(|(node, &value)| node.with_z(value)).collect(),
            quantity,
            range,
            mode: ViewMode::Top,
            colours: SequentialMap::default(),
        }
    };
    let of_axis = |&axis: &usize| [Quantity::Pattern, Quantity::Sensitivity].map(|quantity| surface(axis, quantity));
    Ok(scene.movement.axes().indices().iter().map(of_axis).collect())
}

#[cfg(test)]
mod tests {
    use decoupler_core::{
        dataset::Simulation,
        scene::{Movement, Noise, Rows},
    };

    use super::*;

    fn analysis(Simulation { sensor, scene, .. }: &Simulation) -> Analysis {
        Analysis::new(sensor, scene, || false).unwrap().unwrap()
    }

    #[test]
    fn the_worst_row_has_the_smallest_singular_value_and_each_node_has_its_value() {
        let question = Simulation::default();
        let found = analysis(&question);
        assert_eq!((found.rows.len(), found.surfaces.len()), (10, 1));
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
            let shown = &found.surfaces[0][1].nodes[10 * row..10 * row + 10];
            assert!(shown.iter().zip(&alone.sensitivity_per_mm).all(|(a, b)| a.z == b.z));
        }
        let largest = found.surfaces[0][0]
            .nodes
            .iter()
            .map(|node| node.z.abs())
            .fold(0.0, f64::max);
        assert!((largest - 1.0).abs() < 1e-12);
        assert_eq!(found.noise.total(), 0.0);
        assert_eq!(found.patterns_seen(), 10);
    }

    #[test]
    fn neighbouring_patterns_have_the_same_sign() {
        let found = analysis(&Simulation::default());
        let nodes = &found.surfaces[0][0].nodes;
        for row in 1..10 {
            let along: f64 = (0..10)
                .map(|node| nodes[10 * row + node].z * nodes[10 * row - 10 + node].z)
                .sum();
            assert!(along >= 0.0, "row {row}");
        }
    }

    #[test]
    fn every_source_of_noise_counts() {
        let mut question = Simulation::default();
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
        let mut question = Simulation {
            sensor: SensorModel::new("10x6_3x18".parse().unwrap()),
            ..Simulation::default()
        };
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
        let mut question = Simulation::default();
        question.scene.movement = Movement::SIDEWAYS;
        let found = analysis(&question);
        assert_eq!(found.surfaces.len(), 3);
        let Simulation { sensor, scene, .. } = &mut question;
        assert!(Analysis::new(sensor, scene, || true).unwrap().is_none());
        sensor.geometry.height_mm = -1.0;
        let message = Analysis::new(sensor, scene, || false).unwrap_err().to_string();
        assert!(message.contains("height"), "{message}");
    }
}
