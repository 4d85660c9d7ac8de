use std::{collections::VecDeque, ops::RangeInclusive, sync::Arc, time::Instant};

use glam::DVec3;
use ndarray::Array2;

use super::{message::TruthErrors, session::Watch};
use crate::window::test_view::Frame;
use decoupler_core::{
    dataset::Simulation,
    decoupling::{Decoder, ProgramDecoder},
    live::ZeroGains,
    scene::{Deformation, NoiseSource, Scene},
    sensor::SensorModel,
    surface::SurfaceMap,
};
use decoupler_files::export::NetworkFile;

/// Decodes frames of one sensor: divides them by the gains of the unloaded state, decodes them with the network or
/// without the faulty wires, and compares them with the truth if it is known.
#[derive(Debug)]
pub(super) struct Decoding {
    network: Arc<NetworkFile>,
    decoder: ProgramDecoder,
    pub(super) sensor: SensorModel,
    pub(super) rows: Arc<[usize]>,
    pub(super) surface: Arc<SurfaceMap>,
    pub(super) z_range_mm: RangeInclusive<f64>,
    /// Readings without load: rows × M4, in ohm.
    rest_ohm: Vec<f64>,
    /// Latest frames as received, for [`ZeroGains::estimate`].
    latest_ohm: VecDeque<Vec<f64>>,
    noise: NoiseSource,
    zero: Option<ZeroGains>,
    pub(super) watch: Watch,
    /// The last frame, divided by the gains.
    frame_ohm: Vec<f64>,
    /// Its answer: rows × 3·M2.
    answer_mm: Vec<f64>,
    by_all_mm: Vec<f64>,
    /// Sums of the errors since a fault was named, with all wires and without the faulty ones, and their number.
    since_named: ([f64; 2], u64),
}

impl Decoding {
    /// Prepares to decode frames with the noise of `scene`.
    ///
    /// # Errors
    /// If the sensor or the scene is invalid, with the reason.
    pub(super) fn new(network: Arc<NetworkFile>, scene: &Scene, zero: Option<ZeroGains>) -> Result<Self, String> {
        let simulation = network.problem.sensor;
        let Simulation { sensor, .. } = simulation.ok_or("a network of a recording has no sensor model")?;
        let scale = sensor.scale;
        let rows = scene.rows.read(scale.rows()).map_err(|error| error.to_string())?;
        let at_rest = vec![DVec3::ZERO; scale.nodes_per_row()];
        let mut rest_ohm = Vec::with_capacity(rows.len() * scale.columns());
        for &row in &rows {
            let of_row = sensor
                .row_resistances(row, &at_rest)
                .map_err(|error| error.to_string())?;
            rest_ohm.extend(of_row);
        }
        let (x_mm, y_mm) = sensor.geometry.lattice_mm(scale, &rows);
        let surface = SurfaceMap::shared(&x_mm, &y_mm).map_err(|error| error.to_string())?;
        let height_mm = sensor.geometry.height_mm;
        let noise = scene
            .noise
            .in_test()
            .source(&sensor)
            .map_err(|error| error.to_string())?;
        let answer_mm = vec![0.0; rows.len() * scale.coordinates_per_row()];
        Ok(Self {
            decoder: network.network.decoder(),
            network,
            sensor,
            surface,
            z_range_mm: height_mm - scene.stroke_mm(&sensor.geometry)..=height_mm,
            latest_ohm: VecDeque::with_capacity(ZeroGains::FRAMES),
            noise,
            zero: zero.filter(|zero| zero.is_sound(rows.len(), scale.columns())),
            watch: Watch::new(&sensor, scene, &rows).map_err(|error| error.to_string())?,
            frame_ohm: rest_ohm.clone(),
            rest_ohm,
            by_all_mm: answer_mm.clone(),
            answer_mm,
            since_named: Default::default(),
            rows: rows.into(),
        })
    }

    /// Returns the number of readings of a frame: rows × M4.
    pub(super) fn readings(&self) -> usize {
        self.rest_ohm.len()
    }

    /// Decodes a frame of readings in ohm, all finite and above 0. Returns the mean |error| of z in millimetres if the
    /// true deformation is given.
    ///
    /// # Errors
    /// If the network cannot decode it.
    pub(super) fn decode(
        &mut self,
        readings_ohm: &[f64],
        truth: Option<&Deformation>,
        now: Instant,
    ) -> Result<Option<f64>, String> {
        let oldest = (self.latest_ohm.len() == ZeroGains::FRAMES).then(|| self.latest_ohm.pop_front());
        let mut latest = oldest.flatten().unwrap_or_default();
        latest.clear();
        latest.extend_from_slice(readings_ohm);
        self.latest_ohm.push_back(latest);
        let mut frame_ohm = std::mem::take(&mut self.frame_ohm);
        frame_ohm.copy_from_slice(readings_ohm);
        if let Some(zero) = &self.zero {
            zero.apply(&mut frame_ohm);
        }
        let decoded = self.decode_zeroed(&frame_ohm, truth, now);
        self.frame_ohm = frame_ohm;
        decoded
    }

    fn decode_zeroed(
        &mut self,
        frame_ohm: &[f64],
        truth: Option<&Deformation>,
        now: Instant,
    ) -> Result<Option<f64>, String> {
        let by_all = self.decoder.decode(frame_ohm, &mut self.by_all_mm);
        by_all.map_err(|error| error.to_string())?;
        if self.watch.check(frame_ohm, now) {
            self.since_named = Default::default();
        }
        let is_left_out = self.watch.decode(frame_ohm, &mut self.answer_mm);
        if !is_left_out {
            if self.by_all_mm.iter().any(|coordinate| !coordinate.is_finite()) {
                return Err(NO_ANSWER.to_owned());
            }
            self.answer_mm.copy_from_slice(&self.by_all_mm);
        }
        let Some(truth) = truth else { return Ok(None) };
        let shown_mm = self.error_mm(&self.answer_mm, truth);
        if is_left_out {
            let by_all_mm = self.error_mm(&self.by_all_mm, truth);
            let (sums, count) = &mut self.since_named;
            *sums = [sums[0] + by_all_mm, sums[1] + shown_mm];
            *count += 1;
        }
        Ok(Some(shown_mm))
    }

    fn error_mm(&self, answer_mm: &[f64], truth: &Deformation) -> f64 {
        let nodes = self.sensor.scale.nodes_per_row();
        let height_mm = self.sensor.geometry.height_mm;
        let truth_mm = self.rows.iter().flat_map(|&row| truth.row_mm(row));
        let errors = answer_mm.chunks_exact(3).zip(truth_mm);
        let sum: f64 = errors.map(|(node, u)| (node[2] - (height_mm - u.z)).abs()).sum();
        sum / (self.rows.len() * nodes) as f64
    }

    /// Returns the errors if the truth is known; `shown_mm` is the recent mean error.
    pub(super) fn truth_errors(&self, shown_mm: Option<f64>) -> TruthErrors {
        let (sums, count) = self.since_named;
        TruthErrors {
            shown_mm,
            since_named_mm: (self.watch.state().wire().is_some() && count > 0)
                .then(|| sums.map(|sum| sum / count as f64)),
        }
    }

    /// Takes the unloaded state from the latest frames, and divides readings by its gains from now on.
    pub(super) fn take_zero(&mut self) -> Result<ZeroGains, String> {
        let columns = self.sensor.scale.columns();
        let gains = ZeroGains::estimate(&self.latest_ohm, &self.rest_ohm, columns, &self.noise);
        let gains = gains.map_err(|error| error.to_string())?;
        self.zero = Some(gains.clone());
        Ok(gains)
    }

    /// Divides readings by these gains from now on, if they are of this array.
    pub(super) fn use_zero(&mut self, zero: Option<ZeroGains>) {
        let columns = self.sensor.scale.columns();
        self.zero = zero.filter(|zero| zero.is_sound(self.rows.len(), columns));
    }

    /// Returns the decoded nodes and the surface through them.
    pub(super) fn decoupled(&self) -> Frame {
        let nodes_mm = self.answer_mm.chunks_exact(3).map(DVec3::from_slice).collect();
        self.frame(nodes_mm)
    }

    /// Returns the nodes of a deformation and the surface through them.
    pub(super) fn actual(&self, truth: &Deformation) -> Frame {
        let nodes_mm = self.rows.iter().flat_map(|&row| {
            let of_row = truth.row_mm(row).iter().enumerate();
            of_row.map(move |(node, &u)| self.sensor.displaced_mm(row, node, u))
        });
        self.frame(nodes_mm.collect())
    }

    fn frame(&self, nodes_mm: Arc<[DVec3]>) -> Frame {
        let z_mm: Vec<f64> = nodes_mm.iter().map(|node| node.z).collect();
        Frame {
            grid_mm: self.surface.evaluate(&z_mm).into(),
            nodes_mm,
        }
    }

    /// Returns the drop of each reading of the last frame from its value without load, in percent: rows × M4.
    pub(super) fn drops_percent(&self) -> Array2<f64> {
        let columns = self.sensor.scale.columns();
        Array2::from_shape_fn((self.rows.len(), columns), |(row, column)| {
            let index = row * columns + column;
            100.0 * (1.0 - self.frame_ohm[index] / self.rest_ohm[index])
        })
    }

    /// Returns the root mean square of m/R − 1 over the readings m of the last frame that are not left out, with R from
    /// Eq. (2) at its answer; infinite if the model has no resistance there.
    pub(super) fn residual(&self) -> f64 {
        let scale = self.sensor.scale;
        let (mut sum, mut count) = (0.0, 0);
        let mut model_ohm = vec![0.0; scale.columns()];
        for (index, (ohm, mm)) in self.lines().enumerate() {
            let row = self.rows[index];
            let nodes = mm.chunks_exact(3).map(DVec3::from_slice).enumerate();
            let displacements_mm: Vec<DVec3> = nodes
                .map(|(node, position_mm)| self.sensor.displacement_mm(row, node, position_mm))
                .collect();
            let modelled = self.sensor.row_resistances_into(row, &displacements_mm, &mut model_ohm);
            if modelled.is_err() {
                return f64::INFINITY;
            }
            let used = (0..scale.columns()).filter(|&column| !self.watch.state().leaves_out(row, column));
            for column in used {
                sum += (ohm[column] / model_ohm[column] - 1.0).powi(2);
                count += 1;
            }
        }
        (sum / f64::from(count.max(1))).sqrt()
    }

    /// Returns the number of readings, except those left out, and of coordinates of the last frame outside the range
    /// seen in training; `None` if that is not known.
    pub(super) fn outside(&self) -> (Option<usize>, usize) {
        let mut outside = (Some(0), 0);
        for (index, (ohm, mm)) in self.lines().enumerate() {
            let network = self.network.network.at(index);
            let inputs = network.inputs();
            let is_used = |column: &usize| !self.watch.state().leaves_out(self.rows[index], *column);
            let of_row = inputs.range();
            let of_row = of_row.map(|range| range.outside(inputs.quantity(), ohm).filter(is_used).count());
            outside.0 = outside.0.zip(of_row).map(|(sum, count)| sum + count);
            outside.1 += network.outputs().far_outside(mm).count();
        }
        outside
    }

    /// Returns readings and answer of each row of the last frame.
    fn lines(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        let scale = self.sensor.scale;
        let rows = self.frame_ohm.chunks_exact(scale.columns());
        rows.zip(self.answer_mm.chunks_exact(scale.coordinates_per_row()))
    }
}

const NO_ANSWER: &str = "resistances so far from the training range that the network has no answer";

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use decoupler_core::{
        dataset::Seed,
        decoupling::resistance_residual,
        evaluation::{Run, RunSettings},
        scene::Noise,
    };
    use decoupler_files::live::{Fault, Simulated};

    fn network() -> Arc<NetworkFile> {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "4x4_3x12".parse().unwrap();
        (settings.simulation_mut().unwrap().samples, settings.hidden) = (200, 6);
        settings.training.stopping.epochs = 10;
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        Arc::new(NetworkFile::from_run(&run, None).unwrap())
    }

    #[test]
    fn the_residual_equals_the_librarys_and_leaves_out_faulty_wires() {
        let network = network();
        let scene = Scene {
            noise: Noise::relative(1e-3),
            ..network.settings.simulation().unwrap().scene
        };
        let mut decoding = Decoding::new(Arc::clone(&network), &scene, None).unwrap();
        let mut source = Simulated::new(&decoding.sensor, &scene, Seed(1), 50.0).unwrap();
        let mut ohm = vec![0.0; decoding.readings()];
        source.next_frame(&mut ohm).unwrap();
        let now = Instant::now();
        decoding.decode(&ohm, Some(source.deformation()), now).unwrap();
        let rows = ohm.chunks_exact(12).zip(decoding.answer_mm.chunks_exact(12));
        let squares = rows.map(|(ohm, mm)| resistance_residual(&decoding.sensor, ohm, mm).powi(2));
        let expected = (squares.sum::<f64>() / 4.0).sqrt();
        assert!((decoding.residual() / expected - 1.0).abs() < 1e-9);

        source
            .set_fault(Some(Fault::OpenColumn {
                column: 4,
                before_node: 0,
            }))
            .unwrap();
        let mut shown_mm = None;
        for frame in 1..20 {
            source.next_frame(&mut ohm).unwrap();
            let at = now + Duration::from_secs(frame);
            shown_mm = decoding.decode(&ohm, Some(source.deformation()), at).unwrap();
        }
        let state = decoding.watch.state();
        assert!(state.wire().is_some(), "{state:?}");
        assert!(decoding.residual() < 3e-3, "{}", decoding.residual());
        let [by_all, left_out] = decoding.truth_errors(shown_mm).since_named_mm.unwrap();
        assert!(left_out < by_all, "{left_out} and {by_all}");
    }
}
