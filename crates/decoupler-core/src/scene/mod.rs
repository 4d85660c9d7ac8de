//! The scene: rows read, movement, loading and noise. Decoders model only what varies in the scene.

mod loading;
mod noise;
mod rows;

pub(crate) use loading::DeformationSampler;
pub use loading::{Indenter, IndenterShape, Loading, Radii, TiltedBody};
pub(crate) use noise::standard_normal;
pub use noise::{Noise, NoiseSource, NoisySets};
pub use rows::{RowModel, Rows};

use glam::DVec3;
use rand::Rng;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    sensor::{ArrayScale, Axes, Geometry, SensorModel, short},
    text::Named,
};

/// Rows read, movement, loading and noise of the readings. The default is that of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scene {
    /// Row-wires read, and the sharing of decoders among them.
    pub rows: Rows,
    /// Movement of the nodes.
    pub movement: Movement,
    /// Loading of the surface.
    pub loading: Loading,
    /// Largest compression as a fraction of the height, in (0, 1).
    pub largest_compression: f64,
    /// Noise of the readings.
    pub noise: Noise,
}

/// Invalid scene.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SceneError {
    /// The largest compression is out of range.
    #[error("the largest compression is {} %: it must be above 0 and below 100 % of the height", short(100.0 * .0))]
    Compression(f64),
    /// The row-wire does not exist.
    #[error("row {row} does not exist: the array has rows 1 to {rows}; give one of them")]
    Row {
        /// Requested row, from 1.
        row: usize,
        /// Number of row-wires of the array.
        rows: usize,
    },
    /// Not a choice of rows.
    #[error("'{0}' is not a choice of rows: give all, known, or the number of a row from 1")]
    RowsText(String),
    /// Not a loading.
    #[error(
        "'{0}' is not a loading: give random, smooth:MM (its correlation length), or indenter with :sphere, :flat-punch, \
         :cylinder or :edge"
    )]
    LoadingText(String),
    /// The shift sideways is out of range.
    #[error(
        "the largest shift sideways is {} mm: it must be above 0 and finite; for none, choose movement along z only",
        short(*.0)
    )]
    Shift(f64),
    /// The correlation length is out of range.
    #[error("the correlation length is {} mm: it must be above 0 and finite", short(*.0))]
    CorrelationLength(f64),
    /// The decay length around the indenter is out of range.
    #[error("the decay length of the surface around the indenter is {} mm: it must be above 0 and finite", short(*.0))]
    Spread(f64),
    /// The indenter's radius is out of range.
    #[error("the indenter's radius is from {} to {} mm: give two lengths above 0 in order", short(.0.smallest), short(.0.largest))]
    Radius(Radii),
    /// The indenter's tilt is out of range.
    #[error("the indenter's largest tilt is {} degrees: give from 0 to 45", short(*.0))]
    Tilt(f64),
    /// The noise is out of range.
    #[error("the {what} is {}: give from 0 to {}", short(*.value), short(*.largest))]
    Noise {
        /// Kind of noise.
        what: &'static str,
        /// Value.
        value: f64,
        /// Largest allowed value.
        largest: f64,
    },
    /// The number of bits is out of range.
    #[error("the converter has {0} bits: give from 1 to {most}", most = Noise::MAX_BITS)]
    Bits(u8),
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            rows: Rows::All,
            movement: Movement::Z,
            loading: Loading::RandomNodes,
            largest_compression: 0.2,
            noise: Noise::default(),
        }
    }
}

impl Scene {
    /// Checks every number, except that the row of [`Rows::One`] exists, which [`Rows::read`] checks.
    ///
    /// # Errors
    /// If a number is out of range.
    pub fn check(&self) -> Result<(), SceneError> {
        if !(self.largest_compression > 0.0 && self.largest_compression < 1.0) {
            return Err(SceneError::Compression(self.largest_compression));
        }
        if let Movement::Xyz { largest_shift_mm } = self.movement
            && !(largest_shift_mm > 0.0 && largest_shift_mm.is_finite())
        {
            return Err(SceneError::Shift(largest_shift_mm));
        }
        self.loading.check()?;
        self.noise.check()
    }

    /// Returns the full scale of the deformation: the distance that a node can travel.
    pub fn stroke_mm(&self, geometry: &Geometry) -> f64 {
        self.largest_compression * geometry.height_mm
    }

    /// Draws a deformation of `model`.
    pub fn draw(&self, model: &SensorModel, rng: &mut impl Rng) -> Deformation {
        DeformationSampler::new(self, model).draw(rng)
    }

    /// Returns the number of unknowns of each row-wire: the coordinates that vary in the scene.
    pub fn unknowns_per_row(&self, scale: ArrayScale) -> usize {
        scale.nodes_per_row() * self.movement.axes().count()
    }
}

/// Displacement of each upper node at one moment, in millimetres; z is positive downwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Deformation {
    nodes_per_row: usize,
    /// Row-wires × nodes on a row-wire.
    displacements_mm: Vec<DVec3>,
}

impl Deformation {
    /// Creates a deformation with `displacement_mm(row, node)` at every node.
    pub fn from_fn(scale: ArrayScale, mut displacement_mm: impl FnMut(usize, usize) -> DVec3) -> Self {
        let nodes_per_row = scale.nodes_per_row();
        let nodes = 0..scale.rows() * nodes_per_row;
        Self {
            nodes_per_row,
            displacements_mm: nodes
                .map(|node| displacement_mm(node / nodes_per_row, node % nodes_per_row))
                .collect(),
        }
    }

    /// Returns the displacements of the nodes of row-wire `row`, in millimetres.
    pub fn row_mm(&self, row: usize) -> &[DVec3] {
        &self.displacements_mm[row * self.nodes_per_row..][..self.nodes_per_row]
    }

    /// Returns the positions of the displaced nodes of row-wire `row`, in millimetres.
    pub fn row_positions_mm<'a>(&'a self, model: &'a SensorModel, row: usize) -> impl Iterator<Item = DVec3> + 'a {
        let displacements = self.row_mm(row).iter().enumerate();
        displacements.map(move |(node, &displacement)| model.displaced_mm(row, node, displacement))
    }
}

/// Movement of the nodes, which determines the unknowns of each node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Movement {
    /// Downwards only, as in the paper.
    #[default]
    Z,
    /// Downwards, and sideways by up to `largest_shift_mm` along x and along y.
    Xyz {
        /// Largest shift along x and along y, in either direction.
        largest_shift_mm: f64,
    },
}

impl Named for Movement {
    const WHAT: &'static str = "a choice of axes";
    const ALL: &'static [Self] = &[Self::Z, Self::SIDEWAYS];
}

impl Movement {
    /// Also sideways, by up to a fifth of a millimetre: a tenth of the assumed node pitch.
    pub const SIDEWAYS: Self = Self::Xyz { largest_shift_mm: 0.2 };

    /// Returns the axes of the unknown coordinates.
    pub fn axes(self) -> Axes {
        match self {
            Self::Z => Axes::Z,
            Self::Xyz { .. } => Axes::Xyz,
        }
    }

    /// Returns the largest shift sideways.
    pub fn largest_shift_mm(self) -> f64 {
        match self {
            Self::Z => 0.0,
            Self::Xyz { largest_shift_mm } => largest_shift_mm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Seed, Stream};

    fn scenes() -> Vec<Scene> {
        let mut loadings = vec![
            Loading::RandomNodes,
            Loading::SmoothField {
                correlation_length_mm: 3.0,
            },
        ];
        loadings.extend(Indenter::all().map(Loading::Indenter));
        let with = |movement| {
            loadings.clone().into_iter().map(move |loading| Scene {
                movement,
                loading,
                ..Scene::default()
            })
        };
        with(Movement::Z).chain(with(Movement::SIDEWAYS)).collect()
    }

    #[test]
    fn every_loading_stays_within_the_stroke_and_uses_it() {
        let model = SensorModel::new(ArrayScale::default());
        for scene in scenes() {
            scene.check().unwrap();
            let sampler = DeformationSampler::new(&scene, &model);
            let mut rng = Seed(0).rng(Stream::Training);
            let mut largest = glam::DVec3::ZERO;
            for _ in 0..200 {
                let deformation = sampler.draw(&mut rng);
                for u in (0..10).flat_map(|row| deformation.row_mm(row)) {
                    assert!((0.0..=1.0).contains(&u.z), "{scene:?} {u}");
                    largest = largest.max(u.abs());
                }
            }
            assert!(largest.z > 0.9, "{scene:?} {largest}");
            match scene.movement {
                Movement::Z => assert_eq!((largest.x, largest.y), (0.0, 0.0)),
                Movement::Xyz { largest_shift_mm } => {
                    assert!(largest.x <= largest_shift_mm && largest.y <= largest_shift_mm);
                    assert!(largest.x > 0.0 && largest.y > 0.0);
                }
            }
        }
    }

    #[test]
    fn scenes_survive_serialisation_and_older_files_have_the_papers_defaults() {
        for scene in scenes() {
            let scene = Scene {
                rows: Rows::One(3),
                noise: Noise::relative(1e-3),
                ..scene
            };
            let text = serde_json::to_string(&scene).unwrap();
            assert_eq!(serde_json::from_str::<Scene>(&text).unwrap(), scene, "{text}");
        }
        let older = r#"{"loading":"random_nodes","largest_compression":0.2}"#;
        assert_eq!(serde_json::from_str::<Scene>(older).unwrap(), Scene::default());
    }

    #[test]
    fn invalid_scenes_are_reported() {
        let impossible = [
            (
                Scene {
                    movement: Movement::Xyz { largest_shift_mm: -1.0 },
                    ..Scene::default()
                },
                "shift",
            ),
            (
                Scene {
                    loading: Loading::SmoothField {
                        correlation_length_mm: f64::NAN,
                    },
                    ..Scene::default()
                },
                "correlation length",
            ),
            (
                Scene {
                    noise: Noise::relative(-0.1),
                    ..Scene::default()
                },
                "relative noise",
            ),
            (
                Scene {
                    noise: Noise {
                        converter_bits: Some(0),
                        ..Noise::default()
                    },
                    ..Scene::default()
                },
                "0 bits",
            ),
        ];
        for (scene, word) in impossible {
            let message = scene.check().unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
