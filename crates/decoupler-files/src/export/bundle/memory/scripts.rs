use decoupler_core::text::counted;

use super::ExportedMemory;

impl ExportedMemory {
    /// Module for NumPy.
    pub(super) fn numpy(&self) -> String {
        let constants = &self.constants;
        let list = |values: Vec<f64>| format!("{values:?}");
        let (rates, of_samples): (Vec<f64>, Vec<f64>) = self.exponents().unzip();
        format!(
            "\"\"\"The memory of the network: computes its features from readings as they come.\n\n{restarts}\n\"\"\"\n\n\
             import numpy as np\n\n\
             CHANNELS, KEPT = {channels}, {kept}\n\
             LAGS = {lags:?}\n\
             PER_SECOND = np.array({rates}, dtype=float)\n\
             PER_SAMPLE = np.array({of_samples}, dtype=float)\n\
             # Usual interval between samples in training.\n\
             INTERVAL_S = {interval:?}\n\n\n\
             class Memory:\n    \
             \"\"\"State of one sensor. A copy of `state` is all that is needed to continue from it.\"\"\"\n\n    \
             def __init__(self, state=None):\n        \
             # A row of ones after the first sample, the latest readings, and the averages.\n        \
             self.state = np.zeros(({rows}, CHANNELS)) if state is None else np.array(state, dtype=float)\n\n    \
             def step(self, readings, interval_s=INTERVAL_S):\n        \
             \"\"\"Takes in the next sample, interval_s seconds after the one before; returns its features.\"\"\"\n        \
             readings = np.asarray(readings, dtype=float)\n        \
             if self.state[0, 0] == 0:\n            \
             self.state[:] = readings\n            \
             self.state[0] = 1\n        \
             kept, averages = self.state[1 : 1 + KEPT], self.state[1 + KEPT :]\n        \
             kept[1:] = kept[:-1].copy()\n        \
             kept[0] = readings\n        \
             weights = -np.expm1(-(max(interval_s, 0.0) * PER_SECOND + PER_SAMPLE))\n        \
             averages += weights[:, None] * (readings - averages)\n        \
             past = np.concatenate([kept[LAGS], averages]) if LAGS else averages\n        \
             return np.concatenate([readings, {past}])\n",
            restarts = self.restarts(),
            channels = constants.channels,
            kept = self.kept(),
            lags = constants.lags,
            rates = list(rates),
            of_samples = list(of_samples),
            interval = constants.interval_s,
            rows = self.rows(),
            past = if constants.differences {
                "(readings - past).ravel()"
            } else {
                "past.ravel()"
            },
        )
    }

    /// Function file for MATLAB and GNU Octave.
    pub(super) fn matlab(&self, name: &str) -> String {
        let constants = &self.constants;
        let list = |values: Vec<String>| format!("[{}]", values.join(" "));
        let lags = list(constants.lags.iter().map(|lag| (lag + 2).to_string()).collect());
        let rates = list(self.exponents().map(|(rate, _)| format!("{rate:e}")).collect());
        let of_samples = list(self.exponents().map(|(_, constant)| format!("{constant:e}")).collect());
        let (upper, rows, kept, channels) = (name.to_uppercase(), self.rows(), self.kept(), constants.channels);
        format!(
            "function [features, state] = {name}_memory(readings, interval_s, state)\n\
             %{upper}_MEMORY Computes the features of {upper}_DECODE from readings in order of time.\n\
             %   [FEATURES, STATE] = {upper}_MEMORY(READINGS, INTERVAL_S, STATE) has a line of {features} for each line\n\
             %   of {readings}, each INTERVAL_S seconds after the one before (a scalar applies to all; in training\n\
             %   it was usually {interval:?}). STATE is [] at the start, and continues from an earlier call.\n\n\
             samples = size(readings, 1);\n\
             if size(readings, 2) ~= {channels}\n    error('readings: give {channels} columns');\nend\n\
             if nargin < 2 || isempty(interval_s)\n    interval_s = {interval:?};\nend\n\
             if isscalar(interval_s)\n    interval_s = repmat(interval_s, samples, 1);\nend\n\
             if nargin < 3 || isempty(state)\n    state = zeros({rows}, {channels});\nend\n\
             per_second = {rates};\nper_sample = {of_samples};\n\
             features = zeros(samples, {count});\n\
             for sample = 1:samples\n    \
             now = readings(sample, :);\n    \
             if state(1, 1) == 0\n        state = repmat(now, {rows}, 1);\n        state(1, :) = 1;\n    end\n    \
             state(2:{last}, :) = [now; state(2:{before}, :)];\n    \
             for k = 1:numel(per_second)\n        \
             weight = -expm1(-(max(interval_s(sample), 0) * per_second(k) + per_sample(k)));\n        \
             state({last} + k, :) = state({last} + k, :) + weight * (now - state({last} + k, :));\n    end\n    \
             past = state([{lags}, {last} + (1:numel(per_second))], :);\n    \
             {difference}\
             features(sample, :) = [now, reshape(past', 1, [])];\n\
             end\nend\n",
            count = constants.features(),
            features = counted(constants.features(), "feature"),
            readings = counted(channels, "reading"),
            interval = constants.interval_s,
            last = kept + 1,
            before = kept,
            difference = if constants.differences {
                "past = repmat(now, size(past, 1), 1) - past;\n    "
            } else {
                ""
            },
        )
    }
}
