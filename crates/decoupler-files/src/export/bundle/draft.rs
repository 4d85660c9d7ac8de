use std::fs;

use super::{
    choice::BundlePrecision,
    error::BundleError,
    exported_decoder::Metadata,
    fixed_point::FixedNetworks,
    folder::AtomicFolder,
    iteration::Iteration,
    portable::Portable,
    vectors::{Deviation, Vector, Vectors},
    weights::Weights,
};

/// A bundle of floating-point numbers in the making, which its format fills.
pub(super) struct Draft<'a> {
    /// Prefix of the names of functions and files.
    pub(super) name: &'a str,
    pub(super) folder: &'a AtomicFolder,
    pub(super) portable: &'a Portable,
    pub(super) weights: &'a Weights,
    pub(super) vectors: &'a Vectors,
    pub(super) limits: Deviation,
    pub(super) metadata: &'a Metadata,
    /// Remarks for the user, with cause and cure.
    pub(super) remarks: &'a mut Vec<String>,
}

/// What the README says of the way to call a bundle.
pub(super) struct Call<'a> {
    /// Prefix of the names of functions and files.
    pub(super) name: &'a str,
    pub(super) portable: &'a Portable,
    /// For a bundle in whole numbers.
    pub(super) fixed: Option<&'a FixedNetworks>,
    pub(super) precision: BundlePrecision,
}

impl Draft<'_> {
    /// Writes a file and reads it back.
    ///
    /// # Errors
    /// The operating system refuses.
    pub(super) fn write(&self, file: &str, contents: impl AsRef<[u8]>) -> Result<Vec<u8>, BundleError> {
        self.folder.write(file, contents)?;
        fs::read(self.folder.path().join(file)).map_err(|error| BundleError::read_back(file, error.to_string()))
    }

    /// Deviation of a bundle with these numbers.
    pub(super) fn deviation_of(&self, weights: &Weights) -> Deviation {
        deviation(self.portable, weights, self.vectors)
    }
}

impl Call<'_> {
    /// True if answers to readings that no deformation explains are told apart.
    pub(super) fn tells_unexplained(&self) -> bool {
        let equations = self.portable.equations.as_ref();
        equations.is_some_and(|equations| equations.seeks_solution)
    }
}

/// Deviation of a bundle of `portable` with these numbers.
pub(super) fn deviation(portable: &Portable, weights: &Weights, vectors: &Vectors) -> Deviation {
    vectors.deviation(|vector: &Vector| match &portable.equations {
        None => weights.decode(vector.row, &vector.taken),
        Some(equations) => {
            let first = |map: usize| weights.decode(map, &vector.taken);
            Iteration::new(equations).decode(vector.row, &vector.taken, first)
        }
    })
}
