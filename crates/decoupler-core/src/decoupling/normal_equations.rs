use pulp::{Simd, WithSimd};

/// Writes the lower triangle of [A, b]ᵀ[A, b], row by row, into `entries`. `system` holds A column by column, then b, each
/// padded with zeros to `length`, a multiple of 8.
pub(super) fn write_normal_equations(system: &[f64], length: usize, entries: &mut [f64]) {
    pulp::Arch::new().dispatch(Products {
        system,
        length,
        entries,
    });
}

/// Width of a sum that stays in registers.
const LANES: usize = 8;

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Products<'a> {
    system: &'a [f64],
    length: usize,
    entries: &'a mut [f64],
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            system,
            length,
            entries,
        } = self;
        let columns = system.len() / length;
        let column = |index: usize| &system[index * length..(index + 1) * length];
        let mut begin = 0;
        for i in 0..columns {
            let row = &mut entries[begin..=begin + i];
            let mut j = 0;
            // Four at a time read column i once.
            while j + 4 <= i + 1 {
                let sums = products([column(j), column(j + 1), column(j + 2), column(j + 3)], column(i));
                row[j..j + 4].copy_from_slice(&sums);
                j += 4;
            }
            while j <= i {
                row[j] = products([column(j)], column(i))[0];
                j += 1;
            }
            begin += i + 1;
        }
    }
}

/// Returns the products of several columns with another, each in eight partial sums of fixed order.
#[inline(always)]
fn products<const N: usize>(columns: [&[f64]; N], other: &[f64]) -> [f64; N] {
    let mut sums = [[0.0; LANES]; N];
    for (block, other) in other.as_chunks::<LANES>().0.iter().enumerate() {
        for (sums, column) in sums.iter_mut().zip(&columns) {
            let column: &[f64; LANES] = column[block * LANES..(block + 1) * LANES]
                .try_into()
                .expect("whole registers");
            for lane in 0..LANES {
                sums[lane] += column[lane] * other[lane];
            }
        }
    }
    let mut products = [0.0; N];
    for (product, [a, b, c, d, e, f, g, h]) in products.iter_mut().zip(sums) {
        *product = ((a + e) + (c + g)) + ((b + f) + (d + h));
    }
    products
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers, of which every product and sum is exact in any order.
    #[test]
    fn products_of_all_columns_are_written() {
        for (columns, rows) in [(1, 3), (6, 9), (11, 30)] {
            let length = usize::next_multiple_of(rows, LANES);
            let value = |column: usize, row: usize| ((7 * column + 3 * row) % 11) as f64 - 5.0;
            let mut system = vec![0.0; columns * length];
            for column in 0..columns {
                for row in 0..rows {
                    system[column * length + row] = value(column, row);
                }
            }
            let mut entries = vec![f64::NAN; columns * (columns + 1) / 2];
            write_normal_equations(&system, length, &mut entries);
            let mut entries = entries.into_iter();
            for i in 0..columns {
                for j in 0..=i {
                    let expected: f64 = (0..rows).map(|row| value(i, row) * value(j, row)).sum();
                    assert_eq!(entries.next(), Some(expected), "{i} {j}");
                }
            }
        }
    }
}
