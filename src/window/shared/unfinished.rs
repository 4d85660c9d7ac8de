use super::FileTask;

/// Work that closing the window would cut short.
#[derive(Debug)]
pub struct Unfinished {
    /// Name of the work, which tells it apart from other work of the same view: "Training".
    pub work: &'static str,
    /// Its progress: "epoch 12 of 1000".
    pub progress: String,
    /// Saves what has been done so far, if that is possible.
    pub saving: Option<FileTask>,
    /// True if its result survives the window once the work has ended.
    pub is_kept: bool,
}

impl Unfinished {
    /// Work that can only be discarded, and whose result is gone with the window.
    pub fn discarded(work: &'static str, progress: String) -> Self {
        Self {
            work,
            progress,
            saving: None,
            is_kept: false,
        }
    }
}
