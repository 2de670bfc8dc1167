//! Keeps the alignment of the source: `~`, `=`, `=>`, tags and comments that were in the
//! same column on consecutive lines, with more than one space before one of them.

/// The position of something in the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SourcePlace {
    pub line: usize,
    pub column: usize,
    /// The number of spaces before it.
    pub spaces: usize,
}

/// The position of something that may be aligned.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// Its column in the output.
    pub at: usize,
    pub seen: SourcePlace,
}

/// A line of output.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub text: String,
    /// The stops, from left to right.
    pub stops: Vec<Stop>,
    /// The position of the comment at its end.
    pub comment: Option<Stop>,
}

impl Row {
    /// Moves the text from column `from` on to column `to`.
    fn shift(&mut self, from: usize, to: usize) {
        let Some(by) = to.checked_sub(from) else { return };
        let byte = self.text.char_indices().nth(from).map_or(self.text.len(), |(i, _)| i);
        self.text.insert_str(byte, &" ".repeat(by));
        for stop in self.stops.iter_mut().chain(&mut self.comment).filter(|stop| stop.at >= from) {
            stop.at += by;
        }
    }

    fn width(&self) -> usize {
        self.text.chars().count()
    }

    /// Returns the column at which the code ends.
    fn code(&self) -> usize {
        self.comment.map_or_else(|| self.width(), |stop| stop.at)
    }
}

/// Aligns what the source aligns, unless a line of code would become longer than `width`.
pub(super) fn line_up(rows: &mut [Row], width: usize) {
    let most = rows.iter().map(|row| row.stops.len()).max().unwrap_or(0);
    for k in 0..most {
        for run in runs(rows, |row| row.stops.get(k).copied()) {
            let rows = &mut rows[run];
            let column =
                rows.iter().filter_map(|row| Some(row.stops.get(k)?.at)).max().unwrap_or(0);
            let widest = rows
                .iter()
                .filter_map(|row| Some(row.code() + column - row.stops.get(k)?.at))
                .max();
            if widest.is_some_and(|widest| widest <= width) {
                rows.iter_mut().for_each(|row| row.shift(row.stops[k].at, column));
            }
        }
    }
    // Comments keep their column if the code before them leaves room, so that they also
    // stay aligned with comments further away.
    for run in runs(rows, |row| row.comment) {
        let rows = &mut rows[run];
        let column =
            rows.iter().filter_map(|row| Some(row.comment?.at.max(row.comment?.seen.column))).max();
        for row in rows.iter_mut() {
            if let (Some(stop), Some(column)) = (row.comment, column) {
                row.shift(stop.at, column);
            }
        }
    }
}

/// Returns the longest runs of rows whose stops were in the same column on consecutive
/// lines, if spaces were added to align them.
fn runs(rows: &[Row], stop: impl Fn(&Row) -> Option<Stop>) -> Vec<std::ops::Range<usize>> {
    let seen: Vec<Option<SourcePlace>> =
        rows.iter().map(|row| stop(row).map(|stop| stop.seen)).collect();
    let mut runs = Vec::new();
    let mut start = 0;
    while start < seen.len() {
        let mut end = start + 1;
        while let (Some(a), Some(Some(b))) = (seen[end - 1], seen.get(end))
            && b.line == a.line + 1
            && b.column == a.column
        {
            end += 1;
        }
        if seen[start..end].iter().flatten().any(|seen| seen.spaces > 1) {
            runs.push(start..end);
        }
        start = end;
    }
    runs
}
