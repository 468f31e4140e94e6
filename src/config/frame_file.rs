//! `structure.frame.file`: the tables of a frame from their own file, put into the tree of the test file before it is read.

use std::path::Path;
use std::sync::Arc;

use super::diagnose::{Diagnostics, Finding, Source, syntax};
use super::document::{Datum, KeyPath, Node};
use super::echo::plain;
use super::locator::{FRAME, frame};
use super::overrides::Override;
use super::{ConfigError, Locator, Opened, renamed, text_of};

impl Opened {
    /// Reads the frame that `structure.frame.file` names, in the test file or in an override, and puts its tables beside this key.
    /// A frame that has been read stays unless an override names its file.
    pub(super) fn include_frame(
        &mut self,
        path: &Path,
        overrides: &[Override],
    ) -> Result<(), ConfigError> {
        let (at, key) = (frame(), frame().key("file"));
        let was_read = self.locator.frame_file.is_some();
        let mut names = overrides.iter().filter(|one| one.path() == key).peekable();
        if was_read && names.peek().is_none() {
            return Ok(());
        }
        // An override that cannot be applied is reported with all others.
        names.for_each(|one| drop(one.apply(&mut self.root)));
        let Some((table, named)) = self.root.find(&at).zip(self.root.find(&key)) else {
            return Ok(());
        };
        let (Datum::Table(entries), Datum::Text(name)) = (&table.datum, &named.datum) else {
            return Ok(());
        };
        let refuse = |finding: Finding| {
            let mut locator = self.locator.clone();
            locator.add(overrides.to_vec(), Vec::new());
            locator.refusal(finding)
        };
        let other = entries.iter().find(|(other, _)| other != "file");
        if let Some((other, _)) = other.filter(|_| !was_read) {
            let text = format!("`{at}` has both `file` and `{other}`");
            let finding = Finding::error(at.key(other), text).at_key();
            let finding = finding.label("write it into that file, or remove `file`");
            return Err(refuse(
                finding.beside(key, "the whole frame is read from this file"),
            ));
        }
        self.inputs.clear();
        let bytes = self.inputs.read(name).map(<[u8]>::to_vec);
        let bytes = bytes.map_err(|error| refuse(error.finding(key.clone())))?;
        let file = path.parent().unwrap_or(Path::new("")).join(name);
        let source = Arc::new(Source {
            name: plain(&file.display().to_string()),
            text: text_of(&file, bytes)?,
        });
        let mut tree = Node::parse(&source.text)
            .map_err(|errors| ConfigError::Invalid(Diagnostics(syntax(&source, errors))))?;
        if tree.find(&KeyPath::root().key(FRAME[0])).is_none() {
            let tables = tree;
            tree = Node {
                datum: Datum::Table(Vec::new()),
                ..tables.clone()
            };
            tree.put(&FRAME, tables);
        }
        let moves = renamed::rename(&mut tree);
        let own = Locator::new(Arc::clone(&source), tree.clone());
        let Some(Datum::Table(read)) = tree.take(&FRAME).map(|node| node.datum) else {
            let text = format!("this file has no `[{at}]`");
            return Err(own.refusal(Finding::error(KeyPath::root(), text)));
        };
        let within = |finding: Finding| Err(own.refusal(finding.at_key()));
        if let Datum::Table(rest) = &tree.datum
            && let Some((rest, _)) = rest.first()
        {
            let text = format!("`{rest}` is no table of a frame");
            let finding = Finding::error(KeyPath::root().key(rest), text);
            return within(finding.label(format!("only `[{at}]` is read from this file")));
        }
        if read.iter().any(|(key, _)| key == "file") {
            let text = "the file of a frame cannot name another file";
            return within(Finding::error(key, text).label("the tables must be here"));
        }
        let mut tables = vec![("file".to_owned(), named.clone())];
        tables.extend(read);
        let table = Node {
            datum: Datum::Table(tables),
            ..table.clone()
        };
        self.moves.extend(moves);
        self.locator.include(source, &table);
        self.root.replace(&at, &table);
        Ok(())
    }
}
