"""Reports: one self-contained HTML page each, with figures that need no network.

page.Report collects text, tables and figures; figures has the drawings that several reports share;
style has their colours and axes.
"""
