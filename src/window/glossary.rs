//! Glossary: every term of the field with its definition and, if there is one, its equation. It is the source of the
//! tooltips of terms and of the list of all terms; decoders and training methods provide their own descriptions.

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    training::Method,
};

/// Defines the terms of a group, each with its name, its definition and an optional equation.
macro_rules! terms {
    ($GROUP:ident: $($TERM:ident = $name:literal, $definition:literal $(, $equation:literal)?;)*) => {
        $(
            #[doc = $definition]
            pub const $TERM: crate::window::glossary::Term = crate::window::glossary::Term {
                name: $name,
                definition: $definition,
                equation: concat!("" $(, $equation)?),
                hint: concat!($definition $(, "\n\n", $equation)?),
            };
        )*

        /// Terms of this group.
        pub(super) const $GROUP: &[crate::window::glossary::Term] = &[$($TERM),*];
    };
}

/// Returns all terms in groups, each with its heading, in the order of the pipeline.
pub fn groups() -> [(&'static str, Vec<Term>); 7] {
    let described = |name, definition| Term {
        name,
        definition,
        equation: "",
        hint: definition,
    };
    let methods = Method::all().into_iter();
    let methods = methods.map(|method| described(method.name(), method.summary()));
    let decoders = DecoderKind::ALL.map(|kind| described(kind.name(Precision::Double), kind.meaning()));
    [
        ("Sensor", SENSOR_TERMS.to_vec()),
        ("Scene", SCENE_TERMS.to_vec()),
        ("Network", NETWORK_TERMS.to_vec()),
        ("Training", TRAINING_TERMS.to_vec()),
        ("Training methods", methods.collect()),
        ("Errors", ERROR_TERMS.to_vec()),
        ("Decoders", decoders.to_vec()),
    ]
}

/// Returns true if each word in `typed` occurs in the text, in any order.
pub fn has_words(text: &str, typed: &str) -> bool {
    let text = text.to_lowercase();
    typed.split_whitespace().all(|word| text.contains(&word.to_lowercase()))
}

/// Term of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Term {
    /// Name, as shown in the window.
    pub name: &'static str,
    /// Definition in one or two sentences, with the unit.
    pub definition: &'static str,
    /// Equation; empty for none.
    pub equation: &'static str,
    /// Text of the tooltip: definition and equation.
    pub hint: &'static str,
}

impl Term {
    /// Returns true if each word in `typed` occurs in the name or the definition, in any order.
    pub fn matches(&self, typed: &str) -> bool {
        has_words(&format!("{} {}", self.name, self.definition), typed)
    }
}

terms! { ERROR_TERMS:
    Z_PERCENT = "Z %",
        "AveZerr of the paper: mean |error| of z in percent of the coordinate z, which is never near 0. Always answering \
         the mean scores about 5 % on the paper's scene.",
        "100 · mean(|decoded z − z| / |z|)";
    X_PERCENT = "X %",
        "AveXerr of the paper: mean |error| of x in percent of the coordinate x.",
        "100 · mean(|decoded x − x| / |x|)";
    Y_PERCENT = "Y %",
        "AveYerr of the paper: mean |error| of y in percent of the coordinate y.",
        "100 · mean(|decoded y − y| / |y|)";
    Z_MM = "mm",
        "Mean |error| of z in millimetres.",
        "mean(|decoded z − z|)";
    STROKE_PERCENT = "stroke %",
        "Mean |error| of z in percent of the full scale, the distance a node can travel.",
        "100 · mean(|decoded z − z|) / stroke";
    WORST_NODE = "Worst node",
        "Largest |error| of z of any node in the test set, in mm.",
        "max(|decoded z − z|)";
    LINEAR_MAP = "Linear map",
        "Best affine map from the resistances to the coordinates, one for each row-wire where the row is known to the network. A \
         network that is not better is not worth training.",
        "coordinates = A · R + b";
    MODEL_BASED = "Model-based",
        "Newton's method on Eq. (2), measured like any other decoder: it knows the equations, the noise, and mean and \
         covariance of the loading.";
    PUBLISHED = "Published",
        "Error that the paper reports for this array and these numbers of hidden nodes and samples.";
    RESIDUAL = "Residual",
        "Relative difference between the readings and those that Eq. (2) gives for the decoded deformation (root mean \
         square). It needs no ground truth.",
        "rms((R − R of the decoded nodes) / R)";
    PARETO_FRONT = "Pareto front",
        "The decoders for which no other is both faster and more accurate.";
}

terms! { NETWORK_TERMS:
    HIDDEN_NODES = "Hidden nodes",
        "Number of nodes in the tanh layer between resistances and coordinates.",
        "coordinates = V · tanh(W · inputs + b) + c";
    INPUTS = "Inputs",
        "Quantity that the network reads for each resistance.";
    CONDUCTANCE = "Conductance",
        "1/R. By Eq. (2) it is a sum over nodes, and so the closest to linear in the deformation.";
    LOG_RESISTANCE = "Log-resistance",
        "ln R: relative errors become additive.";
    SCALING = "Scaling",
        "Scaling of the inputs.";
    MIN_MAX = "Min-max",
        "Each channel scaled to −1 to 1, as in the paper.",
        "2 · (x − min) / (max − min) − 1";
    WHITENING = "Whitening",
        "Principal components, each divided by its standard deviation: components of small variance count as much as \
         large ones, unless noise hides them.",
        "component / √(σ² + noise²)";
    STARTS = "Restarts",
        "Number of trainings from different random weights, side by side. Several show how much the results vary.";
    AUTO = "Automatic settings",
        "History of readings, scaling, hidden nodes, method and epochs are chosen by cross-validation on the training samples, in about a \
         minute; the answer is the best combination of ridge, kernel ridge and networks. Turned off, the form begins with the settings that were chosen.";
    COMBINE = "Combine restarts",
        "Keep the restart with the lowest validation error, or average the answers of all restarts: their mean is one network \
         with the hidden nodes of all, and varies less than any of them.";
    SEED = "Seed",
        "Seed of all random numbers: the same seed gives the same network.";
}

terms! { TRAINING_TERMS:
    METHOD = "Method",
        "Algorithm that adjusts the weights.";
    EPOCH = "Epoch",
        "One pass over the training set, after which the weights change.";
    MSE = "mse",
        "Mean square error of the scaled coordinates, each in [−1, 1]; those that are constant are left out.",
        "mse = mean (decoded − actual)²";
    TRAINING_SET = "Training set",
        "The samples to which the network is fitted.";
    VALIDATION_SET = "Validation set",
        "Samples that select the best weights and may end the training early; with 0 there are none, and all epochs are \
         run.";
    TEST_SET = "Test set",
        "Held-out samples, on which all errors are measured and whose snapshots are shown. They are never trained on.";
    VALIDATION_FAILURES = "Validation failures",
        "Training ends after this many epochs without a new best validation error.";
    GRADIENT = "Gradient",
        "Derivative of the training error with respect to the weights; its norm falls towards 0 at a minimum.",
        "∂ mse / ∂ weights";
    DAMPING = "Damping μ",
        "Shortens the steps of Levenberg-Marquardt: with a large μ they follow the gradient, with a small μ they are \
         Gauss-Newton steps.",
        "(J^T J + μ I) · step = −J^T · error";
    EFFECTIVE_PARAMETERS = "Effective parameters",
        "Number of weights that the data determine, as estimated by Bayesian regularisation. Near the number of weights, \
         more hidden nodes may help; far below it, fewer would do.",
        "γ = N − α tr (β J^T J + α I)⁻¹";
}

terms! { SENSOR_TERMS:
    ARRAY_SCALE = "Array scale",
        "M1×M2_M3×M4: row-wires × nodes on each, nodes on each column-wire × column-wires. Any size is possible.";
    ROW_WIRE = "Row-wire",
        "A wire on top of the rubber, with M2 electrode nodes that move with the surface. The row-wires are read one \
         after the other.";
    COLUMN_WIRE = "Column-wire",
        "A wire at the bottom of the rubber, with M3 electrode nodes at rest. Each gives one reading of every row-wire.";
    NODE = "Node",
        "An electrode on a wire, at which current enters or leaves the rubber. The coordinates of the nodes of the \
         row-wires are what is decoded.";
    READING = "Reading",
        "Resistance between a row-wire and a column-wire, in Ω: the parallel connection of the rubber between all of \
         their nodes.",
        "1 / R = Σ Σ 1 / (g · |p + u − q|)    over the nodes p of the row and q of the column, Eq. (2)";
    DROP = "Drop of a reading",
        "How far a reading has fallen below its value in the unloaded state, in percent.",
        "drop = 100 · (1 − R / R unloaded)";
    SNAPSHOT = "Snapshot",
        "Samples of all row-wires at one moment, which share one deformation. Its readings alone, as they come from the \
         sensor, are a frame.";
    FRAME = "Frame",
        "Readings of every row-wire at one moment, as they come from the sensor: the input of a decoder.";
    SAMPLE = "Sample",
        "The readings of one row-wire at one moment, with the coordinates of its nodes: one row of a recording.";
    GROUP = "Group",
        "Samples that belong together, such as those of a snapshot or of one subject, and are never split between \
         training and test.";
    DECOUPLING = "Decoupling",
        "Decoding the coordinates of each node from readings that each mix many nodes.";
    HEIGHT = "Height",
        "Height of the row-wires above the column-wires, undeformed, in mm.";
    RESISTIVITY = "Resistivity",
        "Resistance of the rubber per millimetre (g in the paper), in Ω/mm. It scales all resistances equally.";
    STROKE = "Stroke",
        "Distance that a node can travel downwards, in mm: the full scale of the deformation.",
        "stroke = largest compression · height";
    CONDITION_NUMBER = "Condition number",
        "Worst-case amplification of a relative error in the readings, for the worst row with its nodes pressed halfway.",
        "largest / smallest singular value of the Jacobian of ln R";
    UNKNOWNS = "Unknowns of a row",
        "Number of coordinates to decode from the readings of one row-wire.";
    READINGS = "Readings of a row",
        "Number of resistances measured for one row-wire, one for each column-wire.";
    WORST_ROW = "Worst row",
        "The row-wire with the smallest singular value.";
    SIMILAR_ROWS = "Most similar rows",
        "The two row-wires with the most similar readings at rest, and their relative difference.";
    NOISE = "Noise of a reading",
        "Relative standard deviation of one reading, from all noise sources of the scene.";
    PATTERNS = "Deformation patterns above the noise",
        "Number of deformation patterns of the worst row that the readings determine better than the scene alone does.";
    UNCERTAINTY = "Uncertainty of the worst pattern",
        "Standard deviation of the worst-seen deformation pattern, in mm, from the readings alone.";
    REMAINING = "Remaining spread",
        "Spread of the deformation after a reading, in percent of its spread before (root mean square over patterns).";
    SINGULAR_VALUES = "Singular values",
        "How strongly each independent pattern of movement of a row changes its readings, per millimetre. Patterns with \
         small ones drown in the noise.",
        "∂ ln R / ∂u = U Σ V^T";
    UNLOADED_STATE = "Unloaded state",
        "The readings while nothing presses the sensor. Re-zero measures them over the last half second and divides later \
         readings by the resulting gains, which removes the drift of amplifiers and temperature. A steady contact on fewer \
         than half of the rows is preserved.",
        "gain = R unloaded / R of the model at rest";
    WIRE_FAULT = "Fault",
        "An open, stuck or shorted wire, or a changed gain, reported after four consecutive frames that contradict Eq. (2).";
}

terms! { SCENE_TERMS:
    LOADING = "Loading",
        "Distribution of the deformations in the samples.";
    RANDOM_NODES = "Random nodes",
        "Every node is pressed by an independent random amount, as in the paper.";
    SMOOTH_FIELD = "Smooth field",
        "A smooth random surface: nodes within the correlation length move alike.";
    CORRELATION_LENGTH = "Correlation length",
        "Distance over which the displacements of nodes stay correlated, in mm.";
    INDENTER = "Indenter",
        "A body pressed somewhere onto the surface.";
    SPREAD = "Spread",
        "Decay length of the surface around the indenter, in mm.";
    ROWS = "Rows",
        "Row-wires that are read, by one network or by one network per row.";
    AXES = "Axes",
        "Axes along which nodes move. The other coordinates are not modelled.";
    LARGEST_COMPRESSION = "Largest compression",
        "Largest displacement of a node downwards, in percent of the height.";
    RELATIVE_NOISE = "Relative noise",
        "Noise of each reading (standard deviation), relative to the reading.";
    DRIFT = "Drift",
        "Gain error shared by all readings of a snapshot, e.g. from temperature (standard deviation, in percent).";
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_term_is_listed_once_with_a_sentence() {
        let mut names = BTreeSet::new();
        for term in groups().into_iter().flat_map(|(_, terms)| terms) {
            assert!(
                names.insert((term.name, term.definition)),
                "{} is listed twice",
                term.name
            );
            assert!(
                term.definition.len() > 8 && term.hint.starts_with(term.definition),
                "{term:?}"
            );
            assert!(term.hint.ends_with(term.equation), "{term:?}");
        }
    }
}
