//! The guide and the README: generated pages are fresh, links resolve, and every command block works.

mod common;
#[path = "guide/examples.rs"]
mod examples;
#[path = "guide/reference.rs"]
mod reference;
#[path = "guide/schema.rs"]
mod schema;

use examples::Examples;
use reference::Reference;
use schema::Schema;
use std::path::Path;

#[test]
fn tmp() {
    let s = Schema::new(&gusset::config::json_schema());
    let r = Reference::new(&s);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let e = Examples::new(&s, &[root.join("config")]);
    let mut t = String::new();
    r.contents(&mut t);
    r.write("Top", &e, &mut t);
    std::fs::write("/tmp/a-conf.md", &t).unwrap();
    let m = e.missing(&s, &r.plain_keys());
    std::fs::write("/tmp/a-missing.txt", m.into_iter().collect::<Vec<_>>().join("\n")).unwrap();
}
