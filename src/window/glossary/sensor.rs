use super::term::terms;

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
        "One reading of every row-wire at one moment, also called a frame. The samples of a snapshot share one \
         deformation.";
    SAMPLE = "Sample",
        "The readings of one row-wire at one moment, with the coordinates of its nodes.";
    DECOUPLING = "Decoupling",
        "Recovering the coordinates of each node from readings every one of which mixes many nodes.";
    HEIGHT = "Height",
        "Height of the row-wires above the column-wires, undeformed, in mm.";
    RESISTIVITY = "Resistivity",
        "Resistance of the rubber per millimetre (g in the paper), in Ω/mm. It scales all resistances equally.";
    STROKE = "Stroke",
        "Distance that a node can travel downwards, in mm: the full scale of the deformation.",
        "stroke = largest compression · height";
    CONDITION_NUMBER = "Condition number",
        "Worst-case amplification of a relative error in the readings, for the worst row with its nodes pressed half way.",
        "largest / smallest singular value of the Jacobian of ln R";
    SINGULAR_VALUES = "Singular values",
        "How strongly each independent pattern of movement of a row changes its readings, per millimetre. Patterns with \
         small ones drown in the noise.",
        "∂ ln R / ∂u = U Σ V^T";
    UNLOADED_STATE = "Unloaded state",
        "The readings while nothing presses. Re-zero takes the latest half second as such and divides readings by its \
         gains, which removes the drift of amplifiers and temperature. A contact that is held on fewer than half of the \
         rows is kept.",
        "gain = R unloaded / R of the model at rest";
    WIRE_FAULT = "Fault",
        "A broken, shorted, drifting or stuck wire, named once four frames in a row contradict Eq. (2).";
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
