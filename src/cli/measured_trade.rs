use super::{
    failure::Failure,
    import_arguments::{with_bar, working_folder},
    interruption::Graceful,
    measured_report::Report,
    measured_trade_report::{Measured, TradeOff},
    output::progress_bar,
    trade::Trade,
    training_arguments::refuse_beside_own_data,
};
use crate::{
    dataset::Seed,
    decoupling::DecoderKind,
    evaluation::{self, RunSettings, decoded_unit, measure_target_trade_off},
    import::{Plan, PlannedSets},
    scene::RowModel,
    training::Method,
};

impl Trade {
    /// Measures decoders on the samples of files: those that need no training once, and networks trained by each method.
    pub(super) fn run_measured(&self) -> Result<(), Failure> {
        if self.import.folds.is_some() {
            let message = "--folds: the decoders are measured on the test samples; leave it out";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let mut plan = self.import.plan(self.scene.columns())?;
        let runs = self.measured_settings(plan.import.row_wire.is_some())?;
        let decoders = self.target_decoders()?;
        self.hold_out(&mut plan, &runs[0]);
        let sets = with_bar(self.json, |watch| plan.sets(working_folder(), Seed(self.seed), watch))?;
        self.import.save_recipe(&plan)?;
        let mut trade_off = TradeOff {
            report: Report::new(&plan, &sets),
            decoded: decoded_unit(&sets.test),
            by: plan.division.by,
            targets: sets.recording.targets.clone(),
            measured: Vec::new(),
            refused: Vec::new(),
        };
        let end = self.measure_methods(&plan, &sets, &runs, &decoders, &mut trade_off);
        let done = trade_off.measured.len();
        if end.is_ok() || done > 0 {
            trade_off.print(self.limits(), self.json)?;
        }
        if end? {
            return Ok(());
        }
        Err(Failure::InterruptedTrade { done })
    }

    /// Measures the decoders with the networks of each run; returns `false` once it is interrupted.
    fn measure_methods(
        &self,
        plan: &Plan,
        sets: &PlannedSets,
        runs: &[RunSettings],
        decoders: &[DecoderKind],
        trade_off: &mut TradeOff,
    ) -> Result<bool, Failure> {
        let bar = progress_bar(self.json, runs.len(), "{bar:30} {pos} of {len}, {msg}, {elapsed}");
        let graceful = Graceful::begin();
        let mut decoders = decoders.to_vec();
        for settings in runs {
            let mut plan = plan.clone();
            self.hold_out(&mut plan, settings);
            let seed = settings.seed;
            let (split, test) = plan.divide(&sets.recording, sets.test_recording.as_ref(), seed)?;
            let is_cancelled = || graceful.is_end_requested();
            let method = settings.training.method.short_name();
            bar.set_message(method);
            let TradeOff { measured, refused, .. } = &mut *trade_off;
            let samples = [
                split.training.samples(),
                split.validation.as_ref().map_or(0, |set| set.samples()),
            ];
            let sets = (&split, &test);
            let end = measure_target_trade_off(settings, sets, &self.hidden, &decoders, is_cancelled, |kind, point| {
                match point {
                    Ok(point) => measured.push(Measured {
                        command: self.command(&plan, &point),
                        point,
                        samples,
                    }),
                    Err(error) => refused.push(format!("{kind}: {error}")),
                }
            });
            match end {
                Ok(true) => bar.inc(1),
                Ok(false) => return Ok(false),
                // Nothing is lost that would need words.
                Err(error) if measured.is_empty() => return Err(error.into()),
                Err(error) => {
                    return Err(Failure::TradeOff {
                        place: format!("method {method}"),
                        cause: Box::new(error.into()),
                    });
                }
            }
            // The others do not depend on the method.
            decoders.retain(|kind| kind.needs_network());
        }
        bar.finish_and_clear();
        Ok(true)
    }

    /// The settings of a run by each method.
    fn measured_settings(&self, has_row_wires: bool) -> Result<Vec<RunSettings>, Failure> {
        let (rows, scaling) = self.scene.measured(has_row_wires)?;
        refuse_beside_own_data([
            self.array.is_some(),
            self.samples.is_some(),
            self.test_samples.is_some(),
            false,
        ])?;
        let rows = rows.unwrap_or(RowModel::Shared);
        let mut settings = RunSettings::from(evaluation::Measured { rows });
        settings.inputs.scaling = scaling.unwrap_or(settings.inputs.scaling);
        settings.seed = Seed(self.seed);
        let training = &mut settings.training;
        training.stopping.epochs = self.epochs.unwrap_or(training.stopping.epochs);
        let own = training.method;
        let of_method = |method: &Method| {
            let mut settings = settings;
            // The method of recordings has settings that suit them.
            if method.short_name() != own.short_name() {
                settings.training.method = *method;
            }
            settings
        };
        let methods = if self.method.is_empty() {
            vec![own]
        } else {
            self.method.clone()
        };
        Ok(methods.iter().map(of_method).collect())
    }

    /// The decoders asked for, or all that need no model of a sensor.
    fn target_decoders(&self) -> Result<Vec<DecoderKind>, Failure> {
        if let Some(kind) = self.scene.decoder.iter().find(|kind| kind.needs_sensor()) {
            let message = format!(
                "--decoder {kind}: it solves the equations of a simulated sensor, which own data (--data) have not; leave \
                 it out"
            );
            return Err(Failure::Arguments(message));
        }
        let mut kinds = self.scene.decoders();
        kinds.retain(|kind| !kind.needs_sensor());
        Ok(kinds)
    }

    /// Holds out for validation what the method needs, unless the user or a recipe says how much.
    fn hold_out(&self, plan: &mut Plan, settings: &RunSettings) {
        if !self.import.holds_out() {
            plan.division.validation_fraction = settings.validation_fraction();
        }
    }
}
