//! Frames of large arrays, and the estimated memory for training.

use decoupler_core::{
    evaluation::{Preset, TrainingSize, Workload},
    sensor::ArrayScale,
};

use crate::array::Array;

const ARRAYS: [&str; 4] = ["10x10_5x30", "32x32_16x96", "64x64_32x192", "100x80_40x240"];

pub(crate) fn print() {
    println!("\n## A frame of large arrays, known rows, without noise, one thread\n");
    println!("Milliseconds; networks with 12 hidden nodes. Newton's arithmetic is that of one evaluation per");
    println!("step. Memory is the estimate for training 1000 snapshots with preset best.\n");
    println!(
        "| array | nodes | draw | network, 64 bits | 32 bits | Newton | times the arithmetic | steps | unsolved rows | largest error in mm | memory to train |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for scale in ARRAYS {
        let array = Array::new(scale);
        let nodes = array.scale.rows() * array.scale.nodes_per_row();
        let ([double, single], newton) = (array.network_ms(12), array.newton());
        println!(
            "| {scale} | {nodes} | {:.3} | {double:.4} | {single:.4} | {:.3} | {:.1} | {:.1} | {} of {} | {:.1e} | {:.2} GB |",
            array.drawing_ms(),
            newton.ms,
            newton.ms / newton.arithmetic_ms,
            newton.steps_per_row,
            newton.unsolved,
            array.scale.rows(),
            newton.error_mm,
            training_gb(array.scale)
        );
    }
}

fn training_gb(scale: ArrayScale) -> f64 {
    let mut settings = Preset::Best.settings();
    settings.simulation_mut().unwrap().sensor.scale = scale;
    settings.simulation_mut().unwrap().samples = 1000 * scale.rows();
    Workload::of(&settings, TrainingSize::drawn(&settings).unwrap()).bytes as f64 * 1e-9
}
