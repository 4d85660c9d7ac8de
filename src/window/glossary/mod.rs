//! The glossary: every term of the field with its definition and, where there is one, its equation. What stands under the
//! pointer at a term and what the list of all terms says come from here; decoders and training methods describe
//! themselves.

mod list;

pub use list::{Term, groups, *};
