% Opens the exports of a run in Octave and compares them with what tools/read_samples.m reads. TOOLS, RUN_DIR and EXPORTS
% come from the environment; the exports have every tick.
addpath(getenv('TOOLS'));
log = read_samples(getenv('RUN_DIR'));
m = load(fullfile(getenv('EXPORTS'), 'run.mat'));
n = load(fullfile(getenv('EXPORTS'), 'run.mat73'));
h = load('-hdf5', fullfile(getenv('EXPORTS'), 'run.hdf5'));
names = fieldnames(log.units);
kept = log.state != 10;                            % rows in which the loop only runs warm are in no export
text = @(codes) native2unicode(typecast(uint16(codes(:)'), 'uint8'), 'UTF-16LE');
bits = @(values) typecast(values(:), 'uint64');
for k = 1:numel(names)
    name = names{k};
    assert(iscolumn(m.(name)) || isempty(m.(name)));
    assert(isequal(bits(m.(name)), bits(log.(name)(kept))), name);
    assert(isequal(bits(n.(name)), bits(log.(name)(kept))), name);
    % What MATLAB gives as text, Octave gives as codes in version 7.3, and a text without letters as its dimensions.
    if !isempty(log.units.(name))
        assert(strcmp(m.units.(name), log.units.(name)), name);
        assert(strcmp(text(n.units.(name)), log.units.(name)), name);
    end
    if isfield(h.timing, name)
        assert(isequal(bits(h.timing.(name)), bits(log.(name)(kept))), name);
    else
        assert(isequal(bits(h.samples.(name)), bits(log.(name)(kept))), name);
    end
end
assert(isequal(m.sequence, int64(log.sequence(kept))));
assert(isequal(n.sequence, m.sequence));
% A character beyond U+FFFF becomes U+FFFD in level 5.
assert(strcmp(strrep(text(n.summary), '😀', native2unicode(uint8([239 191 189]), 'UTF-8')), m.summary));
summary = jsondecode(m.summary);
assert(strcmp(summary.status, 'completed'));
printf('judged %d columns, %d rows\n', numel(names), sum(kept));
