//! `gusset schema`.

use super::answer;
use super::args::SchemaArgs;
use super::exit::Exit;
use gusset_config as config;

/// Prints the JSON Schema of the test file, of the file of `gusset serve`, or of a study.
pub fn schema(args: &SchemaArgs) -> anyhow::Result<Exit> {
    answer(if args.serve {
        config::schema_of::<config::ServeFile>()
    } else if args.study {
        config::study_json_schema()
    } else {
        config::json_schema()
    })?;
    Ok(Exit::Done)
}
