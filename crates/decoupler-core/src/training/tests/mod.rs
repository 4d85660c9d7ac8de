//! Tests of training methods against independent solutions.

mod certified;
