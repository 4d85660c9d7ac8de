use super::term::terms;

terms! { ERROR_TERMS:
    Z_PERCENT = "Z %",
        "AveZerr of the paper: mean |error| of z in percent of the coordinate z, which is never near 0. Always answering \
         the mean scores about 5 % on the paper's scene.",
        "100 · mean(|decoupled z − z| / |z|)";
    X_PERCENT = "X %",
        "AveXerr of the paper: mean |error| of x in percent of the coordinate x.",
        "100 · mean(|decoupled x − x| / |x|)";
    Y_PERCENT = "Y %",
        "AveYerr of the paper: mean |error| of y in percent of the coordinate y.",
        "100 · mean(|decoupled y − y| / |y|)";
    Z_MM = "mm",
        "Mean |error| of z in millimetres.",
        "mean(|decoupled z − z|)";
    STROKE_PERCENT = "stroke %",
        "Mean |error| of z in percent of the full scale, the distance a node can travel.",
        "100 · mean(|decoupled z − z|) / stroke";
    WORST_NODE = "Worst node",
        "Largest |error| of z of any node in the test set, in mm.",
        "max(|decoupled z − z|)";
    LINEAR_MAP = "Linear map",
        "Best affine map from the resistances to the coordinates, one for each row-wire where the row is known to the network. A \
         network that is not better is not worth its training.",
        "coordinates = A · R + b";
    REFERENCE = "Reference",
        "Bayesian reference: the error that remains given the noise and the loading of the scene. On average, no decoder of a \
         row's own readings does better. Without noise, only the rounding of the readings is left.";
    PUBLISHED = "Published",
        "What the paper reports for this array, hidden nodes and samples.";
    RESIDUAL = "Residual",
        "Relative difference between the readings and those that Eq. (2) gives for the decoded deformation (root mean \
         square). It needs no ground truth.",
        "rms((R − R of the decoded nodes) / R)";
    PARETO_FRONT = "Pareto front",
        "The decoders that no other beats: whatever is more accurate costs more time.";
}
