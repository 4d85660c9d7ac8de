//! A touched sensor, and the answers of decoders to its readings.

use std::{
    ops::RangeInclusive,
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::{DecodeError, Decoder},
    evaluation::RunError,
    job::Job,
    machine::node_pairs_per_row,
    sensor::{SensorError, SensorModel},
};
use glam::DVec3;
use ndarray::Array2;

use super::touch::Touch;

/// Sensor deformed by a [`Touch`]: positions of its nodes and readings of its wires, without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Pressed {
    /// Coordinates of the nodes: rows read × 3·M2.
    coordinates_mm: Vec<f64>,
    /// Readings by Eq. (2): rows read × M4.
    readings_ohm: Array2<f64>,
}

/// Answer of a decoder to the readings of a touched sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct PressedAnswer {
    /// Decoded coordinates: rows read × 3·M2.
    pub coordinates_mm: Vec<f64>,
    /// Mean |decoupled z − z| of the nodes.
    pub mean_mm: f64,
    /// Largest |decoupled z − z|.
    pub worst_mm: f64,
    /// Time to decode the frame: the shortest of several, since other load on the machine can only increase it. `None`
    /// if the frame was decoded too few times, because the answer became stale or decoding is slow.
    pub time: Option<Duration>,
}

impl Pressed {
    /// Touches `sensor`, of which `rows` are read and whose nodes can travel `stroke_mm`.
    ///
    /// # Errors
    /// If a resistance is not a positive finite number.
    pub fn new(sensor: &SensorModel, rows: &[usize], touch: &Touch, stroke_mm: f64) -> Result<Self, SensorError> {
        let deformation = touch.deformation(sensor, stroke_mm);
        let mut readings_ohm = Array2::zeros((rows.len(), sensor.scale.columns()));
        let mut coordinates_mm = Vec::with_capacity(rows.len() * sensor.scale.coordinates_per_row());
        for (&row, mut readings) in rows.iter().zip(readings_ohm.rows_mut()) {
            let readings = readings
                .as_slice_mut()
                .expect("a row of a standard array is contiguous");
            sensor.row_resistances_into(row, deformation.row_mm(row), readings)?;
            let places = deformation.row_positions_mm(sensor, row);
            coordinates_mm.extend(places.flat_map(|place| place.to_array()));
        }
        Ok(Self {
            coordinates_mm,
            readings_ohm,
        })
    }

    /// Number of pairs of nodes that [`Self::new`] evaluates, at one or two nanoseconds each.
    pub fn node_pairs(sensor: &SensorModel, rows: &[usize]) -> f64 {
        rows.len() as f64 * node_pairs_per_row(sensor)
    }

    /// Returns the positions of the nodes of the rows read, row by row.
    pub fn nodes_mm(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.coordinates_mm.chunks_exact(3).map(DVec3::from_slice)
    }

    /// Returns the resistances: rows read × M4.
    pub fn readings_ohm(&self) -> &Array2<f64> {
        &self.readings_ohm
    }

    /// Decodes the readings.
    ///
    /// # Errors
    /// If a reading cannot be decoded, or the job is cancelled since the answer is no longer needed.
    ///
    /// # Panics
    /// If the decoder was fitted to other rows.
    pub fn answer(&self, decoder: &mut dyn Decoder, job: &Job<'_>) -> Result<PressedAnswer, RunError> {
        let begun = Instant::now();
        self.answer_by(&|| begun.elapsed(), decoder, job)
    }

    /// As [`Self::answer`], with the times of a clock.
    fn answer_by(
        &self,
        clock: &dyn Fn() -> Duration,
        decoder: &mut dyn Decoder,
        job: &Job<'_>,
    ) -> Result<PressedAnswer, RunError> {
        /// Number of timed repeats, of which the shortest counts.
        const TIMES: RangeInclusive<usize> = 3..=5;
        /// Maximum time spent on the repeats.
        const LONGEST: Duration = Duration::from_millis(30);
        let mut decode = |coordinates_mm: &mut [f64]| {
            let begun = clock();
            self.decode(decoder, coordinates_mm, job).map(|()| clock() - begun)
        };
        let mut coordinates_mm = vec![0.0; self.coordinates_mm.len()];
        let mut times = vec![decode(&mut coordinates_mm)?];
        // Repeats have a separate buffer: an interrupted one must not change the answer.
        let mut again_mm = coordinates_mm.clone();
        while times.len() < *TIMES.end() && times.iter().sum::<Duration>() < LONGEST {
            match decode(&mut again_mm) {
                Err(RunError::Cancelled(_)) => break,
                time => times.push(time?),
            }
        }
        let errors = coordinates_mm.iter().zip(&self.coordinates_mm).skip(2).step_by(3);
        let errors_mm = Vec::from_iter(errors.map(|(decoded, actual)| (decoded - actual).abs()));
        // Keeps NaN: the error of a NaN answer is NaN.
        let larger = |worst: f64, error: &f64| {
            if *error > worst || error.is_nan() {
                *error
            } else {
                worst
            }
        };
        Ok(PressedAnswer {
            mean_mm: errors_mm.iter().sum::<f64>() / errors_mm.len() as f64,
            worst_mm: errors_mm.iter().fold(0.0, larger),
            time: times.iter().min().copied().filter(|_| TIMES.contains(&times.len())),
            coordinates_mm,
        })
    }

    /// Decodes row by row, so that slow decoders can be interrupted.
    fn decode(&self, decoder: &mut dyn Decoder, coordinates_mm: &mut [f64], job: &Job<'_>) -> Result<(), RunError> {
        let answers = coordinates_mm.chunks_exact_mut(decoder.outputs());
        for (row_index, (readings, answer)) in self.readings_ohm.rows().into_iter().zip(answers).enumerate() {
            job.check()?;
            let readings = readings.to_slice().expect("a row of a standard array is contiguous");
            decoder
                .decode_row(row_index, readings, answer)
                .map_err(|error| DecodeError { row_index, ..error })?;
        }
        Ok(())
    }
}

impl PressedAnswer {
    /// Returns the decoded positions of the nodes, row by row.
    pub fn nodes_mm(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.coordinates_mm.chunks_exact(3).map(DVec3::from_slice)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    };

    use glam::DVec2;

    use super::{super::touch::Print, *};
    use decoupler_core::{
        dataset::Dataset,
        decoupling::{NewtonDecoder, Program, ProgramDecoder},
        evaluation::{Errors, Run, RunSettings},
        scene::{Indenter, Scene},
    };

    fn sensor() -> SensorModel {
        SensorModel::new("10x6_3x18".parse().unwrap())
    }

    fn touch() -> Touch {
        Touch {
            print: Some(Print {
                indenter: Indenter::default(),
                place_mm: DVec2::new(11.3, 8.2),
                depth_mm: 0.7,
            }),
            nodes_mm: [((8, 1), 0.35)].into(),
        }
    }

    #[test]
    fn newton_finds_the_touched_positions_of_the_nodes() {
        let (sensor, rows) = (sensor(), Vec::from_iter(0..10));
        let pressed = Pressed::new(&sensor, &rows, &touch(), 1.0).unwrap();
        let moved = pressed.nodes_mm().nth(8 * 6 + 1).unwrap();
        assert_eq!(moved, sensor.displaced_mm(8, 1, DVec3::Z * 0.35));
        let mut newton = NewtonDecoder::new(&sensor, &Scene::default(), &rows).unwrap();
        let answer = pressed.answer(&mut newton, &Job::UNINTERRUPTED).unwrap();
        assert!(
            answer.worst_mm < 1e-9 && answer.mean_mm <= answer.worst_mm,
            "{answer:?}"
        );
        let cancelled = pressed.answer(&mut newton, &Job::new(&|| true));
        assert!(matches!(cancelled, Err(RunError::Cancelled(_))), "{cancelled:?}");
    }

    /// Decoder that is slow for the first frames, as on a busy machine, by a clock of its own.
    #[derive(Debug)]
    struct Hampered {
        frames: usize,
        slow: usize,
        clock_ms: Arc<AtomicU64>,
    }

    impl Hampered {
        const QUICK_MS: u64 = 1;
        const SLOW_MS: u64 = 4;
    }

    impl Decoder for Hampered {
        fn channels(&self) -> usize {
            18
        }

        fn outputs(&self) -> usize {
            18
        }

        fn decode_rows(&mut self, _: &[usize], _: &[f64], answer: &mut [f64]) -> Result<(), DecodeError> {
            answer.fill(0.0);
            self.frames += 1;
            let ms = if self.frames <= self.slow {
                Self::SLOW_MS
            } else {
                Self::QUICK_MS
            };
            self.clock_ms.fetch_add(ms, Ordering::Relaxed);
            Ok(())
        }
    }

    #[test]
    fn the_time_is_the_shortest_of_several_and_a_single_one_is_not_reported() {
        let pressed = Pressed::new(&sensor(), &[3], &touch(), 1.0).unwrap();
        let time = |slow, stale_after: usize| {
            let clock_ms = Arc::new(AtomicU64::new(0));
            let mut decoder = Hampered {
                frames: 0,
                slow,
                clock_ms: Arc::clone(&clock_ms),
            };
            let asked = std::cell::Cell::new(0);
            let is_stale = || asked.replace(asked.get() + 1) >= stale_after;
            let clock = || Duration::from_millis(clock_ms.load(Ordering::Relaxed));
            let answer = pressed.answer_by(&clock, &mut decoder, &Job::new(&is_stale));
            answer.ok().map(|answer| answer.time)
        };
        let never = usize::MAX;
        let [quick, slow] = [Hampered::QUICK_MS, Hampered::SLOW_MS].map(Duration::from_millis);
        assert_eq!(time(1, never), Some(Some(quick)));
        assert_eq!(time(9, never), Some(Some(slow)));
        // Answered, but interrupted before there are enough times.
        assert_eq!(time(0, 2), Some(None));
        assert_eq!(time(0, 0), None);
    }

    /// Compares with [`Errors`] of a test set of this single snapshot.
    #[test]
    fn errors_agree_with_a_test_set_of_one_snapshot() {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor = sensor();
        settings.simulation_mut().unwrap().samples = 100;
        let run = Run::prepare(settings).unwrap();
        let rows = [2, 5, 7];
        let pressed = Pressed::new(&sensor(), &rows, &touch(), 1.0).unwrap();
        let targets = Array2::from_shape_vec((3, 18), pressed.coordinates_mm.clone()).unwrap();
        let set = Dataset::new(pressed.readings_ohm.clone(), targets, Some(&rows), vec![0; 3]).unwrap();
        let mut mean = ProgramDecoder::new(Program::mean(run.test()));
        let answer = pressed.answer(&mut mean, &Job::UNINTERRUPTED).unwrap();
        let decoded = Array2::from_shape_vec((3, 18), answer.coordinates_mm.clone()).unwrap();
        let errors = Errors::measure(&set, &decoded, 1.0);
        assert!(
            (answer.mean_mm - errors.z_mm).abs() < 1e-15,
            "{} {}",
            answer.mean_mm,
            errors.z_mm
        );
        assert_eq!(answer.worst_mm, errors.worst_mm);
    }

    #[test]
    fn an_untouched_sensor_has_its_readings_at_rest() {
        let sensor = sensor();
        let pressed = Pressed::new(&sensor, &[3], &Touch::default(), 1.0).unwrap();
        let at_rest = sensor.row_resistances(3, &[DVec3::ZERO; 6]).unwrap();
        assert_eq!(pressed.readings_ohm().row(0).to_vec(), at_rest);
    }
}
