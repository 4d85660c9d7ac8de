/// A level of noise, as one would type it.
pub fn noise_name(noise: f64) -> String {
    if noise == 0.0 || noise >= 0.01 {
        noise.to_string()
    } else {
        format!("{noise:e}")
    }
}
