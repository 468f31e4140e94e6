//! The names of the program: one table each of limits, events, endings, phases and columns.
//!
//! A row of a table has a name, a unit, a sentence for people, and the page of the guide that explains it. All other modules
//! read these tables: the loop, the files of a run folder, the report, the live page, the schema and the guide. This module
//! depends on no other module, and knows no clock, file or thread.
//!
//! | table | holds |
//! |---|---|
//! | [`limit`] | what is limited, of an axis and of the test as a whole |
//! | [`event`] | what happens in a test |
//! | [`ending`] | why a test ends, its exit code and `status` |
//! | [`phase`] | the phases of a test, and their codes |
//! | [`mod@column`] | the columns of a row |
//! | [`explained`] | the meaning of a name, from all tables |

pub mod column;
pub mod ending;
pub mod event;
pub mod explained;
pub mod limit;
pub mod phase;
