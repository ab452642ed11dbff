% Octave's ode15s on the loop of Table 6, restarted at every located event; called by opponents.py.
%
%   octave-cli ode15s.m NUMBERS.txt RESULT.txt
%
% NUMBERS.txt holds tolerance, longest step, spacing and number of the grid's times, number of elements, size of the
% state, and the struct Loop of baseline.c. RESULT.txt receives the CPU time of the solver in s and the positions.
1;

function dy = slope (t, y, p, slips, sigma)
  n = p(7); w = p(5); v = y(2);
  goal = p(4) * (1 - cos (w * t)); rate = p(4) * w * sin (w * t);
  torque = p(2) * (goal - y(1)) + p(3) * (rate - v) - p(28) * v;
  dy = zeros (size (y));
  for side = 0:1
    base = 7 + 22 * side;
    x = v / p(base + 20);
    s = p(base + 19) + (p(base + 18) - p(base + 19)) * exp (-x * x);
    first = 3; count = n;
    if (side == 1)
      first = 3 + n; count = ifelse_ (p(6) == 2, p(29), 0);
    end
    for i = 0:count-1
      force = y(first + i);
      torque = torque + ifelse_ (side == 0, -force, force);
      if (slips(first - 2 + i))
        dy(first + i) = p(base + 17) * (p(base + 9 + i) * sigma - force / s);
      else
        dy(first + i) = p(base + 1 + i) * v;
      end
    end
  end
  if (p(6) == 2) torque = torque + p(50) * v; end
  if (p(6) == 1)
    x = rate / p(49);
    s = p(48) + (p(47) - p(48)) * exp (-x * x);
    last = 3 + n;
    dy(last) = rate - p(51) * abs (rate) / s * y(last);
    torque = torque + p(51) * y(last) + p(52) * dy(last) + p(50) * rate;
  end
  dy(1) = v;
  dy(2) = torque / p(1);
end

function r = ifelse_ (c, a, b)
  if (c) r = a; else r = b; end
end

function g = limits (y, p, slips, sigma, elements)
  % What every element misses its break-away by; the last entry: the reversal.
  g = -1e9 * ones (elements + 1, 1);
  v = y(2); n = p(7); way = ifelse_ (v >= 0, 1, -1);
  for i = 0:elements-1
    if (! slips(i + 1))
      base = ifelse_ (i < n, 7, 29); j = ifelse_ (i < n, i, i - n);
      x = v / p(base + 20);
      s = p(base + 19) + (p(base + 18) - p(base + 19)) * exp (-x * x);
      g(i + 1) = way * y(3 + i) / p(base + 9 + j) - s;
    end
  end
  if (any (slips)) g(end) = -10 * sigma * v; end
end

function [value, stop, way] = event (t, y, p, slips, sigma, elements)
  value = max (limits (y, p, slips, sigma, elements)); stop = 1; way = 1;
end

numbers = load (argv (){1});
tolerance = numbers(1); longest = numbers(2); spacing = numbers(3); count = numbers(4);
elements = numbers(5); states = numbers(6); p = numbers(7:end);
atol = tolerance * ones (states, 1);
atol(2:2+elements) = 1e3 * tolerance;
if (p(6) == 1) atol(end) = 1e-2 * tolerance; end
grid = spacing * (0:count-1)'; found = zeros (count, 1);
y = zeros (states, 1); t = 0; sigma = 1; slips = false (elements, 1);
begin = cputime ();
while (t < grid(end) - 1e-12)
  options = odeset ("RelTol", tolerance, "AbsTol", atol, "MaxStep", longest, "InitialStep", 1e-7, ...
                    "Events", @(t, y, varargin) event (t, y, p, slips, sigma, elements));
  times = [t; grid(grid > t + 1e-12)];
  if (numel (times) == 2) times = [t; (t + times(2)) / 2; times(2)]; end
  [at, states_at, te, ye, ie] = ode15s (@(t, y) slope (t, y, p, slips, sigma), times, y, options);
  rows = min (round (at / spacing) + 1, count);
  on = abs (grid(rows) - at) < 1e-12;
  found(rows(on)) = states_at(on, 1);
  if (isempty (ie)) break; end
  t = te(end); y = reshape (ye(end, :), [], 1);
  g = limits (y, p, slips, sigma, elements);
  if (any (slips) && g(end) >= max (g(1:end-1)))
    slips(:) = false; y(2) = 0;
  else
    sigma = ifelse_ (y(2) >= 0, 1, -1);
    [~, which] = max (g(1:end-1));
    slips(which) = true;
  end
end
spent = cputime () - begin;
file = fopen (argv (){2}, "w");
fprintf (file, "%.17g\n", spent, found);
fclose (file);
