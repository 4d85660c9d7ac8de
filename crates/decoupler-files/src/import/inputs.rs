use std::path::Path;

use decoupler_core::{
    dataset::{Memory, RowOrder},
    problem::{Channel, Problem},
    text::counted,
};
use ndarray::Array2;

use super::{
    Column, ImportError, Recipe, TableError, Watch,
    columns::{Files, Meanings, called, near, position},
    csv_table::named,
    derived::DerivedStream,
    selection::{order_note, seconds},
    table::name_and_unit,
};

/// Inputs of a network, read from a file.
#[derive(Clone, Debug)]
pub struct InputTable {
    /// Samples × inputs of the network: the readings or, with a memory, their features.
    pub readings: Array2<f64>,
    /// Row-wire of each sample, from 0, if the recipe names a row-wire column and the file has it.
    pub row_wires: Option<Vec<usize>>,
    /// Time of each sample in seconds, if the recipe names a time column and the file has it; NaN where it is missing.
    pub times_s: Option<Vec<f64>>,
    /// Line of each sample, from 1.
    pub lines: Vec<u64>,
    /// Last line of a text file, if it is cut off and therefore left out.
    pub torn_line: Option<u64>,
    /// Notes on times, which a memory needs: lines that are left out, and the order of the lines.
    pub warnings: Vec<String>,
    /// Columns of the recipe that say when or to what a sample belongs, as far as the file has them: time, group and
    /// row-wire. Each has a title, with the unit in brackets if there is one, and the text of each cell, empty if it is
    /// missing.
    pub kept: Vec<(String, Vec<String>)>,
}

/// Columns of a table that contain the inputs of a network.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct InputColumns {
    /// Column index of each input, in the order of the network.
    pub(super) inputs: Vec<usize>,
    /// Index of the row-wire column, if there is one.
    pub(super) row_wire: Option<usize>,
    /// Index of the time column and the seconds in its unit, if there is one.
    pub(super) time: Option<(usize, f64)>,
    /// Index of the group column, if a memory needs it and there is one.
    pub(super) group: Option<usize>,
    /// Columns copied to the output, with their titles.
    pub(super) kept: Vec<(usize, String)>,
    /// Number of columns of the table.
    pub(super) width: usize,
}

impl InputColumns {
    /// Finds the inputs of a network of `problem` and the other columns of `recipe` in the cells of a header or, without one, in
    /// `width` columns, and those derived from them, whose cells follow those of a line. Columns without names are called c1, c2,
    /// … as in a recording without a header; if the inputs have other names, the columns are the inputs in their order, after the
    /// number of the row-wire if `has_row_wire`.
    ///
    /// # Errors
    /// If an input has no column of its name, or a column with a different unit, a derived column cannot be computed, or the
    /// number of columns is wrong.
    pub(super) fn of(
        header: &[String],
        width: usize,
        problem: &Problem,
        recipe: &Recipe,
        has_row_wire: bool,
    ) -> Result<(Self, DerivedStream), String> {
        let mut columns = named(header, width);
        let time = recipe.time.as_deref().map(|name| (name, recipe.unit_of(name)));
        let derived = DerivedStream::new(&recipe.derive, &mut columns, time).map_err(|error| error.to_string())?;
        let found = Self::find(&columns, !header.is_empty(), problem, recipe, has_row_wire)?;
        Ok((Self { width, ..found }, derived))
    }

    /// Returns the first `count` columns or, if the first has the row-wire, those after it.
    pub(super) fn in_order(count: usize, begins_with_row_wire: bool) -> Self {
        let before = usize::from(begins_with_row_wire);
        Self {
            inputs: (before..before + count).collect(),
            row_wire: begins_with_row_wire.then_some(0),
            width: before + count,
            ..Self::default()
        }
    }

    /// Returns the first input that several cells of a header name.
    pub(super) fn named_twice(header: &[String], inputs: &[Channel]) -> Option<String> {
        let count = |input: &&Channel| header.iter().filter(|cell| name_and_unit(cell).0 == input.name).count();
        Some(inputs.iter().find(|input| count(input) > 1)?.name.clone())
    }

    /// Returns `true` if the cells are a header: the names of all inputs, the names of some inputs among other texts, or only
    /// texts, as many as there are inputs. A single text is a header in the first line only: elsewhere it may be garbage.
    pub(super) fn is_header(cells: &[String], inputs: &[Channel], is_first_line: bool) -> bool {
        let is_name = |cell: &String| inputs.iter().any(|input| input.name == name_and_unit(cell).0);
        let is_text = |cell: &&String| !cell.trim().is_empty() && cell.trim().parse::<f64>().is_err();
        let names = cells.iter().filter(|cell| is_name(cell)).count();
        let texts = cells.iter().filter(is_text).count();
        (names >= inputs.len() && Self::has_all(cells, inputs))
            || (names > 0 && texts > 0)
            || (texts == cells.len() && texts >= inputs.len() && (texts > 1 || is_first_line))
    }

    /// Returns `true` if the cells are a header with the names of all inputs.
    pub(super) fn has_all(cells: &[String], inputs: &[Channel]) -> bool {
        Self::inputs_of(&named(cells, cells.len()), inputs).is_ok()
    }

    /// Replaces `readings` by the inputs of a line.
    pub(super) fn gather(&self, cells: &[f64], readings: &mut Vec<f64>) {
        readings.clear();
        readings.extend(self.inputs.iter().map(|&column| cells[column]));
    }

    /// Time of a line in seconds; `None` without a time.
    pub(super) fn time_s(&self, cells: &[f64]) -> Option<f64> {
        let time_s = self.time.map(|(column, unit_s)| unit_s * cells[column]);
        time_s.filter(|time_s| time_s.is_finite())
    }

    /// Finds the inputs by their names or, unless the columns have names, as derived ones do, by their order.
    fn find(
        columns: &[Column],
        has_header: bool,
        problem: &Problem,
        recipe: &Recipe,
        has_row_wire: bool,
    ) -> Result<Self, String> {
        let inputs = &problem.inputs;
        let found = Self::inputs_of(columns, inputs).map(|found| Self::with_others(columns, found, problem, recipe));
        let is_complete = |found: &Self| found.row_wire.is_some() >= has_row_wire;
        if has_header || !recipe.derive.is_empty() || found.as_ref().is_ok_and(is_complete) {
            return found;
        }
        let expected = usize::from(has_row_wire) + inputs.len();
        match columns.len() {
            width if width == expected => Ok(Self::in_order(inputs.len(), has_row_wire)),
            width => Err(format!(
                "{} where {expected} are needed, separated by commas; give the inputs of the network in their order, or a \
                 header",
                counted(width, "cell")
            )),
        }
    }

    fn inputs_of(columns: &[Column], inputs: &[Channel]) -> Result<Vec<usize>, String> {
        let find = |Channel { name, unit, .. }: &Channel| {
            let [column] = called(columns, name)[..] else {
                let near = near(columns, name);
                return Err(format!(
                    "there is no column '{name}', which is an input of the network; {near}"
                ));
            };
            match (&columns[column].unit, unit) {
                (Some(found), Some(expected)) if found != expected => {
                    let trained = format!("the network was trained on {expected}");
                    Err(format!("column '{name}' is in {found}, and {trained}; convert it"))
                }
                _ => Ok(column),
            }
        };
        inputs.iter().map(find).collect()
    }

    /// Returns the columns with the `inputs`, and the other columns of `recipe`.
    fn with_others(columns: &[Column], inputs: Vec<usize>, problem: &Problem, recipe: &Recipe) -> Self {
        let other = |name: &Option<String>| position(columns, name.as_ref()?);
        let time = other(&recipe.time).and_then(|column| {
            let unit = columns[column].unit.as_deref();
            let unit = unit.or_else(|| recipe.unit_of(recipe.time.as_ref()?));
            Some((column, seconds(unit)?))
        });
        let group = other(&recipe.group);
        let row_wire = other(&recipe.row_wire);
        let kept = [other(&recipe.time), group, row_wire].into_iter().flatten();
        let kept = kept.filter(|column| !inputs.contains(column)).map(|column| {
            let Column { name, unit, .. } = &columns[column];
            (column, Channel::new(name, unit.as_deref()).title())
        });
        Self {
            kept: kept.collect(),
            row_wire,
            group: group.filter(|_| problem.memory.is_some()),
            inputs,
            time,
            width: columns.len(),
        }
    }
}

impl Recipe {
    /// Reads the inputs of a network of `problem` from the file at `path`: the columns with their names or, without a header,
    /// as many columns as there are inputs, after the number of the row-wire if `has_row_wire`. A memory continues as in
    /// training, by the group, row-wire and time of each line, if the file has these columns.
    ///
    /// # Errors
    /// If the file cannot be read, a column is missing or has a different unit, or a cell is missing or not a number.
    pub fn read_inputs(
        &self,
        path: &Path,
        problem: &Problem,
        has_row_wire: bool,
        watch: Watch<'_>,
    ) -> Result<InputTable, ImportError> {
        let mut files = Files::of(vec![self.read(path, None, &[], watch)?], Vec::new());
        files.tables[0].check_widths().map_err(|error| error.in_file(path))?;
        let has_header = files.tables[0].has_header();
        let found = InputColumns::find(&files.columns, has_header, problem, self, has_row_wire);
        let found = found.map_err(|error| TableError::Contents(error).in_file(path))?;
        // A memory cannot place a row without a time.
        let time = found.time.filter(|_| problem.memory.is_some()).map(|(id, _)| id);
        if let Some(id) = time {
            let given = self.time.as_deref().and_then(|name| self.unit_of(name));
            let unit = files.columns[id].unit.take();
            files.columns[id].unit = unit.or(given.map(str::to_owned));
        }
        files.meanings = Meanings {
            inputs: found.inputs,
            time,
            group: found.group,
            row_wire: found.row_wire,
            ..Meanings::default()
        };
        files.check_numbers()?;
        let (table, columns, meanings) = (&files.tables[0], &files.columns, &files.meanings);
        let is_missing = |id: usize, row: usize| columns[id].is_missing(row);
        for &id in meanings.inputs.iter().chain(&meanings.row_wire) {
            if let Some(row) = (0..table.rows).find(|&row| is_missing(id, row)) {
                let reason = "a network needs all of its inputs, so leave the line out";
                let reason = format!("{} is missing; {reason}", columns[id].name);
                return Err(TableError::in_row(table.line(row), reason).in_file(path));
            }
        }
        let is_placed = |row: &usize| time.is_none_or(|id| !is_missing(id, *row));
        let (placed, without_time): (Vec<usize>, Vec<usize>) = (0..table.rows).partition(is_placed);
        let mut warnings = Vec::new();
        if let Some(&row) = without_time.first() {
            let verb = if without_time.len() == 1 { "is" } else { "are" };
            warnings.push(format!(
                "{} without a time, which the history of readings needs, {verb} left out; the first is line {}",
                counted(without_time.len(), "line"),
                table.line(row)
            ));
        }
        let mut readings = Array2::from_shape_fn((placed.len(), meanings.inputs.len()), |(row, input)| {
            files.number(meanings.inputs[input], placed[row])
        });
        let times_s = found.time.map(|(id, unit_s)| {
            let times_s = placed.iter().map(|&row| unit_s * files.number(id, row));
            times_s.collect()
        });
        if let Some(memory) = &problem.memory {
            let needs_clock = self.memory.as_ref().is_some_and(Memory::needs_clock);
            let history = files.past(&placed, &placed, needs_clock)?(readings);
            if let order @ (RowOrder::Restarts { first_row, .. } | RowOrder::Shuffled { first_row, .. }) =
                history.order()
            {
                warnings.extend(order_note(order, table.line(placed[first_row])));
            }
            let features = history.features(memory);
            readings = features
                .map_err(|error| ImportError::from(error).of_file(path))?
                .into_owned();
        }
        let texts = |id: usize| placed.iter().map(move |&row| columns[id].text(row).into_owned());
        let kept = found.kept.into_iter().map(|(id, title)| (title, texts(id).collect()));
        Ok(InputTable {
            readings,
            row_wires: files.row_wires(&placed)?,
            times_s,
            lines: placed.iter().map(|&row| table.line(row)).collect(),
            torn_line: table.torn_line,
            warnings,
            kept: kept.collect(),
        })
    }
}
