//! Scaling of the time per frame with rows, nodes and hidden nodes.

use crate::{
    array::{Array, NewtonFrame},
    exponent::exponent,
};

pub(crate) fn print() {
    println!("\n## Scaling of the time per frame, one thread\n");
    println!("Milliseconds, and the exponent of the power law through them. The array has three times as many");
    println!("column-wires as nodes on a row-wire, and half as many nodes on a column-wire as rows.\n");
    println!("| growing | sizes | what | milliseconds | exponent |\n|---|---|---|---|---:|");
    let rows = [10, 20, 40, 80];
    let by_rows = rows.map(|rows| Array::new(&format!("{rows}x16_{}x48", rows / 2)));
    print_frames("rows", &rows, &by_rows);
    let nodes = [8, 16, 32, 64];
    let by_nodes = nodes.map(|nodes| Array::new(&format!("16x{nodes}_8x{}", 3 * nodes)));
    print_frames("nodes of a row-wire", &nodes, &by_nodes);
    let hidden = [6, 12, 24, 48];
    let array = Array::new("32x32_16x96");
    let times = hidden.map(|hidden| array.network_ms(hidden));
    line(
        "hidden nodes",
        &hidden,
        "network, 64 bits",
        times.map(|[double, _]| double),
    );
    line(
        "hidden nodes",
        &hidden,
        "network, 32 bits",
        times.map(|[_, single]| single),
    );
}

fn print_frames(growing: &str, sizes: &[usize; 4], arrays: &[Array; 4]) {
    line(growing, sizes, "draw", arrays.each_ref().map(Array::drawing_ms));
    let networks = arrays.each_ref().map(|array| array.network_ms(12));
    line(growing, sizes, "network, 64 bits", networks.map(|[double, _]| double));
    line(growing, sizes, "network, 32 bits", networks.map(|[_, single]| single));
    let newton: [NewtonFrame; 4] = arrays.each_ref().map(Array::newton);
    assert!(
        newton.iter().all(|frame| frame.unsolved == 0),
        "careful steps would be timed"
    );
    line(growing, sizes, "Newton", newton.map(|frame| frame.ms));
}

fn line(growing: &str, sizes: &[usize; 4], what: &str, ms: [f64; 4]) {
    let sizes_text = sizes.map(|size| size.to_string()).join(", ");
    let times = ms.map(|ms| format!("{ms:.4}")).join(", ");
    println!(
        "| {growing} | {sizes_text} | {what} | {times} | {:.2} |",
        exponent(sizes, &ms)
    );
}
